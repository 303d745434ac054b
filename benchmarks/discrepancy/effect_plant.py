"""A stopping vehicle, integrated at 1 kHz: the world in which effects are hidden.

It shares no code with `models`. Its base is a braking force fixed by grade and by the speed at
brake onset, after a dead time; every effect, named or not, is written here a second time from its
formula, so that a mistake in the product's own laws shows as a disagreement.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .plant_physics import Floats, Physics, Stops

GRAVITY = 9.80665  # [m/s²]
STEP = 0.001  # Step of the integration [s]
_MAX_STOP = 14.0  # [s] after the onset; a vehicle that rolls longer does not stop


class DrivenStops(NamedTuple):
    """True motion: (n, samples) at ``time`` since the command, and (n,) for rest and distance."""

    time: Floats  # (samples,) [s]
    # speed, station, x, y, yaw, yaw_rate, grade, roll: SI, station from the command on
    speed: Floats
    station: Floats
    x: Floats
    y: Floats
    yaw: Floats
    yaw_rate: Floats
    grade: Floats
    roll: Floats
    rest: Floats  # time of standstill since the command, inf without standstill [s]
    distance: Floats  # distance from the command to rest [m]
    deceleration: Floats  # value just before rest [m/s²]


def drive(physics: Physics, stops: Stops, time: Floats, step: float = STEP) -> DrivenStops:
    """Drive all stops in their order, sampled at times since each command [s].

    Brakes stay warm from one to the next.
    """
    speed, station, rest, distance, last = _drive(_exact(physics), stops, time, step)
    curvature = stops.curvature[:, None]
    yaw = stops.heading[:, None] + curvature * station
    x, y = _places(stops, station)
    wave = stops.wave[:, None] * np.sin(
        2.0 * np.pi * station / stops.wave_length[:, None] + stops.wave_phase[:, None]
    )
    roll = np.broadcast_to(stops.roll[:, None], speed.shape)
    poses = (x, y, yaw, curvature * speed, stops.grade[:, None] + wave, roll)
    return DrivenStops(time, speed, station, *poses, rest, distance, last)


def speeds(physics: Physics, stops: Stops, time: Floats, step: float = STEP) -> Floats:
    """Speed of :func:`drive` alone, shape (n, samples) [m/s]."""
    speed: Floats = _drive(_exact(physics), stops, time, step)[0]
    return speed


def _exact(physics: Physics) -> Physics:
    return Physics(*(float(value) for value in physics))


def _places(stops: Stops, station: Floats) -> tuple[Floats, Floats]:
    """Positions along arcs that begin at each command."""
    curvature = np.where(np.abs(stops.curvature) < 1e-6, 1e-6, stops.curvature)[:, None]
    h = stops.heading[:, None]
    x = stops.x[:, None] + (np.sin(h + curvature * station) - np.sin(h)) / curvature
    y = stops.y[:, None] - (np.cos(h + curvature * station) - np.cos(h)) / curvature
    return x, y


class StopMoment(NamedTuple):
    """State of one stop, SI: body, ground under it, time ``since`` the onset, ``clock`` time."""

    speed: float
    grade: float
    roll: float
    x: float
    y: float
    yaw: float
    clock: float
    since: float


@njit(cache=True)
def _moment(stops: Stops, i: int, onset: float, since: float, speed: float, s: float) -> StopMoment:
    """Stop i at a station of its arc."""
    curvature, heading = stops.curvature[i], stops.heading[i]
    if abs(curvature) < 1e-6:
        curvature = 1e-6
    yaw = heading + curvature * s
    x = stops.x[i] + (math.sin(yaw) - math.sin(heading)) / curvature
    y = stops.y[i] - (math.cos(yaw) - math.cos(heading)) / curvature
    grade = stops.grade[i] + stops.wave[i] * math.sin(
        2.0 * math.pi * s / stops.wave_length[i] + stops.wave_phase[i]
    )
    clock = stops.clock[i] + onset + since
    return StopMoment(speed, grade, stops.roll[i], x, y, yaw, clock, since)


@njit(cache=True)
def _patched(patch: float, x: float, y: float, radius: float, now: StopMoment) -> float:
    """F_b/W added by a circle [1]."""
    if patch != 0.0 and (now.x - x) ** 2 + (now.y - y) ** 2 <= radius**2:
        return patch
    return 0.0


@njit(cache=True)
def _demanded_force(p: Physics, run: int, v_i: float, now: StopMoment) -> float:
    """F_b/W before build-up, heat and friction."""
    grade, yaw = now.grade, now.yaw
    force: float = (p.m_m * v_i + p.b_m) * grade + p.m_b * v_i + p.b_b
    if run >= p.step_run:
        force = force * p.step_scale + p.step_delta
    force += p.asymmetry * max(grade, 0.0) + p.nonlinearity * grade * abs(grade)
    force += p.cross_slope * abs(now.roll) + p.drift * now.clock
    force += _patched(p.patch, p.patch_x, p.patch_y, p.patch_radius, now)
    force += _patched(p.patch_2, p.patch_2_x, p.patch_2_y, p.patch_2_radius, now)
    force += _patched(p.patch_3, p.patch_3_x, p.patch_3_y, p.patch_3_radius, now)
    force += _patched(p.patch_4, p.patch_4_x, p.patch_4_y, p.patch_4_radius, now)
    force += p.furrow * math.cos(2.0 * (yaw - p.furrow_direction))
    if p.ripple != 0.0:
        force += p.ripple * math.sin(2.0 * math.pi * now.x / p.ripple_length)
    return force


@njit(cache=True)
def _deceleration(p: Physics, force: float, curvature: float, now: StopMoment) -> float:
    """Deceleration by a braking force F_b/W and by all other forces [m/s²]."""
    v = now.speed
    u = v + p.wind * math.cos(now.yaw - p.wind_direction)
    a = GRAVITY * (force + math.sin(now.grade) + p.viscous * v + p.turning * abs(curvature) * v)
    a += p.drag * v * v + p.wind_drag * (abs(u) * u - v * v)
    return a


@njit(cache=True)
def _drive(
    p: Physics, stops: Stops, time: Floats, step: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    n, m = len(stops.speed), len(time)
    speed, station = np.zeros((n, m)), np.zeros((n, m))
    rest, distance, last = np.full(n, np.inf), np.full(n, np.inf), np.zeros(n)
    heat, cooled_since = 0.0, 0.0
    for i in range(n):
        v_i = stops.speed[i]
        onset = p.dead_time + stops.delay[i]
        k = 0
        while k < m and time[k] <= onset:
            speed[i, k], station[i, k] = v_i, v_i * time[k]
            k += 1
        heat *= math.exp(-(stops.clock[i] + onset - cooled_since) / p.fade_tau)
        curvature = stops.curvature[i]
        if abs(curvature) < 1e-6:
            curvature = 1e-6
        t, v, s, built, a = onset, v_i, v_i * onset, 0.0, 0.0
        while v > 0.0 and t < onset + _MAX_STOP:
            # Midpoint: the slopes halfway decide the step.
            v_mid, s_mid = v, s
            for half in range(2):
                since = t - onset + 0.5 * step * half
                now = _moment(stops, i, onset, since, v_mid, s_mid)
                force = _demanded_force(p, i, v_i, now)
                force *= stops.friction[i]
                if p.lag > 0.0:
                    ahead = 0.5 * step * (half + 1)
                    built_mid = force + (built - force) * math.exp(-ahead / p.lag)
                    force = built_mid
                force /= 1.0 + p.fade * heat
                force = min(force, p.friction * math.cos(now.grade) * math.cos(now.roll))
                a = _deceleration(p, force, curvature, now)
                if half == 0:
                    v_mid, s_mid = v - 0.5 * step * a, s + 0.5 * step * v
            if p.lag > 0.0:
                built = built_mid
            heat += step * (GRAVITY * max(force, 0.0) * v_mid - heat / p.fade_tau)
            v_new, s_new, t_new = v - step * a, s + step * v_mid, t + step
            if v_new <= 0.0:
                part = v / (v - v_new)
                rest[i], distance[i] = t + part * step, s + 0.5 * v * part * step
                last[i] = a
            while k < m and time[k] <= t_new:
                share = (time[k] - t) / step
                speed[i, k] = max(v + share * (v_new - v), 0.0)
                station[i, k] = min(s + share * (s_new - s), distance[i])
                k += 1
            v, s, t = v_new, s_new, t_new
        while k < m:
            station[i, k] = distance[i] if rest[i] < np.inf else s
            speed[i, k] = 0.0 if rest[i] < np.inf else v
            k += 1
        cooled_since = stops.clock[i] + t
    return speed, station, rest, distance, last
