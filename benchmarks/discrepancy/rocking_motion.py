"""A vehicle of the vertical plane, and the equations of its stops, compiled.

A sprung body heaves and pitches on two unsprung axles. Brush tyres wind up over a relaxation
length, brake pressure is of second order, and the pads follow it with play.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numba import njit

from .effect_plant import GRAVITY
from .plant_physics import Floats, Stops, draw_ranged, ranged
from .world_changes import Changes
from .world_logs import vehicle_table

SETTLE = 0.8  # driven before the log begins [s]
_AFTER = 1.1  # driven after standstill [s]
_GAIN, _INTEGRAL = 6.0, 4.0  # of the speed controller [1/s], [1/s²]
_TYRE_OVER_SPRING = 9.0  # vertical stiffness of a tyre over that of its spring [1]
_SLOW = 0.3  # speed below which the damping of a standing tyre shows [m/s]
_TYRE_DAMPING = 0.25  # of the car on tyres that stand [1]
_STANDSTILL = 0.01  # [m/s]

_V, _STATION, _HEAVE, _HEAVE_RATE, _PITCH, _PITCH_RATE = range(6)
# Of the front axle; one more is the rear axle: its height, hop, tyre's deflection, wheels.
_AXLE, _AXLE_RATE, _WOUND, _OMEGA, _TURN = range(6, 16, 2)
_PRESSURE, _PRESSURE_RATE, _LAGGED, _PADS, _ONSET_SPEED, _INTEGRATED, _HEAT, _SIZE = range(16, 24)


_SOFTEST = 0.04  # largest angle by which the body pitches on its springs under brakes [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class RockingCar:
    """One vehicle, SI; forces of its brakes as shares of its weight, fixed at the onset."""

    mass: float
    wheelbase: float
    height: float  # of the centre of gravity
    radius: float
    rear: float  # distance from that centre to the rear axle over the wheelbase [1]
    axle_share: float = ranged(0.02, 0.06)  # mass of each axle over that of the car [1]
    frequency: float = ranged(1.0, 5.0)  # of the body in heave [Hz]
    damping: float = ranged(0.2, 0.5)  # of it [1]
    stiffness: float = ranged(9.0, 20.0)  # of a tyre's force by slip, over its load [1]
    relaxation: float = ranged(0.3, 0.8)  # of the tyres [m]; the range is over the radius
    m_m: float = ranged(-0.02, 0.02)
    b_m: float = ranged(-0.1, 0.1)
    m_b: float = ranged(-0.008, 0.008)
    b_b: float
    front: float = ranged(-0.04, 0.04)  # share of the brakes; the range is around the ideal one [1]
    rolling: float = ranged(0.01, 0.05)  # resistance over the load [1]
    dead_time: float = ranged(0.1, 0.35)
    build_up: float = ranged(0.005, 0.035)  # of the pressure: mean delay [s]
    play: float = ranged(0.0, 0.04)  # hysteresis of the pads over the full force [1]
    lag_behind: float = ranged(0.0, 0.02)  # share by which the speed stays below the command [1]
    counts: int  # per turn of each encoder; 0 has a receiver on the roof
    window: int  # samples that counts are averaged over [1]
    roof: float  # height of the receiver [m]
    late: float  # delay of the receiver [s]
    mount: float  # pitch of the pitch sensor's mount, uphill positive [rad]

    @property
    def force(self) -> float:
        """Braking force over the weight on level ground, at standstill [1]."""
        return (self.b_b * (1.0 - self.play) + self.rolling) / (1.0 + self.axle_share)

    @property
    def table(self) -> dict[str, float | str]:
        track, cg_x = 0.7 * self.wheelbase, self.rear * self.wheelbase
        sizes = (self.wheelbase, track, cg_x, self.height, self.radius)
        return vehicle_table(self.mass, *sizes)


def draw_car(rng: np.random.Generator) -> RockingCar:
    """Draw a vehicle between a small robot and a utility car."""
    wheelbase = float(rng.uniform(0.6, 2.6))
    height = min(float(rng.uniform(0.25, 0.7)), 0.45 * wheelbase)
    level, rear = float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.44, 0.56))
    softest = math.sqrt(level * GRAVITY * height / _SOFTEST) / (math.pi * wheelbase)
    radius = float(rng.uniform(0.1, 0.14)) + 0.08 * wheelbase
    mass = float(np.clip(150.0 * wheelbase**1.6 * rng.uniform(0.6, 1.4), 60.0, 900.0))
    numbers = draw_ranged(RockingCar, rng)
    numbers["frequency"] = max(numbers["frequency"], softest)
    numbers["relaxation"] *= radius
    numbers["front"] += rear + level * height / wheelbase
    counts, window = rng.integers(100, 401) * (rng.random() < 0.5), rng.integers(2, 5)
    roof, late, mount = rng.uniform((0.1, 0.03, -0.01), (0.5, 0.06, 0.01)).tolist()
    numbers |= {"mass": mass, "wheelbase": wheelbase, "height": height, "radius": radius}
    numbers |= {"rear": rear, "b_b": level, "roof": height + roof, "late": late, "mount": mount}
    return RockingCar(**numbers, counts=int(counts), window=int(window))


def _forces_of_stops() -> Any:
    names = [f.name for kind in (RockingCar, Changes) for f in fields(kind) if f.name != "factor"]
    return namedtuple("StopForces", (*names, *Stops._fields, "strength", "target", "onset", "lead"))


StopForces = _forces_of_stops()
"""Numbers of one stop, SI: those of car, changes and stop, and the factor on the brakes [1], the
speed until the onset [m/s], its time since the command [s], the distance before that [m]."""


@njit(cache=True)
def _slope(p: Any, station: float) -> float:
    along = 2.0 * math.pi * station / p.wave_length + p.wave_phase
    slope: float = p.grade + p.wave * math.sin(along)
    return slope


@njit(cache=True)
def _drag(p: Any, v: float, station: float) -> float:
    """Deceleration by air [m/s²]."""
    yaw = p.heading + p.curvature * (station - p.lead)
    ahead = v + p.wind * math.cos(yaw - p.wind_from)
    drag: float = p.air * abs(ahead) * ahead
    return drag


@njit(cache=True)
def _ground(p: Any, v: float, station: float) -> float:
    """Resistance of the ground over the weight, beyond rolling [1]."""
    gone = station - p.lead
    force: float = p.cross * abs(p.roll) + p.turning * abs(p.curvature * v)
    x, y, radius, delta = p.patch
    if radius > 0.0:
        chord = p.heading + 0.5 * p.curvature * gone
        if math.hypot(p.x + gone * math.cos(chord) - x, p.y + gone * math.sin(chord) - y) < radius:
            force += delta
    yaw = p.heading + p.curvature * gone
    force += p.furrows * math.cos(2.0 * (yaw - p.furrows_along))
    force += p.ripple * math.sin(2.0 * math.pi * station / p.ripple_length)
    return force


@njit(cache=True)
def _pads(p: Any, s: Floats, braking: bool, slope: float, h: float) -> float:
    """Force of the pads over the weight, after one step of pressure, lag and play [1]."""
    level = (p.m_m * s[_ONSET_SPEED] + p.b_m + p.eager) * slope
    level += p.m_b * s[_ONSET_SPEED] + p.b_b
    level += p.asymmetry * max(slope, 0.0) + p.nonlinearity * slope * abs(slope)
    level = max(level, 0.0) * p.strength / (1.0 + p.fade * s[_HEAT]) if braking else 0.0
    pulse = 2.0 / p.build_up
    s[_PRESSURE_RATE] += h * pulse**2 * (level - s[_PRESSURE])
    s[_PRESSURE_RATE] /= 1.0 + 2.0 * pulse * h
    s[_PRESSURE] += h * s[_PRESSURE_RATE]
    s[_LAGGED] += min(1.0, h / max(p.lag, h)) * (s[_PRESSURE] - s[_LAGGED])
    wide = p.play * p.b_b
    s[_PADS] = min(max(s[_PADS], s[_LAGGED] - wide), s[_LAGGED] + wide)
    force: float = max(s[_PADS], 0.0)
    return force


@njit(cache=True)
def _tyre(p: Any, s: Floats, axle: int, share: float, load: float, h: float) -> float:
    """Force of an axle's brush tyres that brakes the car [N]."""
    at_axle = s[_V] - (p.height - p.radius) * s[_PITCH_RATE]
    sliding = at_axle - s[_OMEGA + axle] * p.radius
    by_slip = p.stiffness * p.mass * GRAVITY * share
    max_force = p.grip * load
    limit = 3.0 * max_force * p.relaxation / by_slip
    wound = (s[_WOUND + axle] + h * sliding) / (1.0 + h * abs(at_axle) / p.relaxation)
    s[_WOUND + axle] = wound = min(max(wound, -limit), limit)
    u = abs(wound) / max(limit, 1e-9)
    force: float = math.copysign(max_force * (3.0 * u - 3.0 * u**2 + u**3), wound)
    standing = 2.0 * _TYRE_DAMPING * math.sqrt(by_slip / p.relaxation * p.mass * share)
    force += standing * sliding * math.exp(-abs(s[_V]) / _SLOW)
    held: float = min(max(force, -max_force), max_force)
    return held


@njit(cache=True)
def _bounce(p: Any, s: Floats, total: float, slope: float, h: float) -> None:
    """Heave, pitch and axles under this braking force [N]."""
    sprung = p.mass * (1.0 - 2.0 * p.axle_share)
    lift, moment = 0.0, p.height * total
    for axle in range(2):
        share = p.rear if axle == 0 else 1.0 - p.rear
        arm = p.wheelbase * ((p.rear - 1.0) if axle == 0 else p.rear)
        k = share * sprung * (2.0 * math.pi * p.frequency) ** 2
        c = 2.0 * p.damping * math.sqrt(k * share * sprung)
        rate = s[_HEAVE_RATE] + arm * s[_PITCH_RATE] - s[_AXLE_RATE + axle]
        spring = -k * (s[_HEAVE] + arm * s[_PITCH] - s[_AXLE + axle]) - c * rate
        lift, moment = lift + spring, moment + arm * spring
        push = -spring - _TYRE_OVER_SPRING * k * s[_AXLE + axle]
        s[_AXLE_RATE + axle] += h * push / (p.axle_share * p.mass)
    lighter = GRAVITY * (math.cos(slope) * math.cos(p.roll) - 1.0)
    s[_HEAVE_RATE] += h * (lift / sprung - lighter)
    s[_PITCH_RATE] += h * moment / (sprung * (0.45 * p.wheelbase) ** 2)
    s[_HEAVE] += h * s[_HEAVE_RATE]
    s[_PITCH] += h * s[_PITCH_RATE]
    for axle in range(2):
        s[_AXLE + axle] += h * s[_AXLE_RATE + axle]


@njit(cache=True)
def _advance(p: Any, s: Floats, t: float, h: float) -> None:
    """One step of all bodies, from time ``t`` since the command [s]."""
    slope, braking, v = _slope(p, s[_STATION]), t >= p.onset, s[_V]
    level, drag = _pads(p, s, braking, slope, h), _drag(p, v, s[_STATION])
    ground, weight, total, drive = _ground(p, v, s[_STATION]), p.mass * GRAVITY, 0.0, 0.0
    if not braking:
        s[_ONSET_SPEED] = v
        s[_INTEGRATED] += h * _INTEGRAL * (p.target - v)
        drive = p.mass * (_GAIN * (p.target - v) + s[_INTEGRATED])
    spring = p.mass * (1.0 - 2.0 * p.axle_share) * (2.0 * math.pi * p.frequency) ** 2
    spin = 0.5 * p.axle_share * p.mass * p.radius**2  # discs
    for axle in range(2):
        share = p.rear if axle == 0 else 1.0 - p.rear
        load = max(share * (weight - _TYRE_OVER_SPRING * spring * s[_AXLE + axle]), 0.0)
        force = _tyre(p, s, axle, share, load, h)
        total += force
        brakes = p.front if axle == 0 else 1.0 - p.front
        held = brakes * level * weight + p.rolling * load + share * weight * ground
        driven = force + drive * share - min(held, 0.0)
        driven -= 0.5 * p.viscous * weight * s[_OMEGA + axle] * p.radius
        free = s[_OMEGA + axle] + h * p.radius / spin * driven
        # Brakes hold a wheel and never turn it.
        remaining = max(abs(free) - h * p.radius / spin * max(held, 0.0), 0.0)
        s[_OMEGA + axle] = math.copysign(remaining, free)
        s[_TURN + axle] += h * s[_OMEGA + axle]
    _bounce(p, s, total, slope, h)
    s[_V] -= h * (total / p.mass + GRAVITY * math.sin(slope) + drag)
    s[_STATION] += h * s[_V]
    s[_HEAT] += h * (GRAVITY * level * max(v, 0.0) - s[_HEAT] / p.cooling)


@njit(cache=True)
def stop(p: Any, time: Floats, heat: float, step: float) -> tuple[Floats, Floats, float, float]:
    """Drive one stop, sampled at ``time`` since its command [s], with this heat [J/kg].

    Returns:
        Rows of speed, station, pitch, pitch rate, grade; angles of both axles' wheels, shapes
        (samples, 5) and (samples, 2); time of rest [s], inf without standstill; heat.
    """
    s = np.zeros(_SIZE)
    s[_V], s[_ONSET_SPEED], s[_HEAT] = p.target, p.target, heat
    s[_OMEGA : _OMEGA + 2] = p.target / p.radius
    s[_INTEGRATED] = GRAVITY * (math.sin(_slope(p, 0.0)) + p.rolling + p.viscous * p.target)
    s[_INTEGRATED] += _drag(p, p.target, 0.0) + GRAVITY * _ground(p, p.target, 0.0)
    rows, turns = np.zeros((len(time), 5)), np.zeros((len(time), 2))
    count, k, rest, steps = round((SETTLE - time[0]) / step), 0, math.inf, 0
    while k < len(time):
        t = (steps - count) * step
        if t >= time[k] - 1e-9:
            rows[k, :2], rows[k, 4] = s[:2], _slope(p, s[_STATION])
            rows[k, 2:4], turns[k] = s[_PITCH : _PITCH + 2], s[_TURN : _TURN + 2]
            k += 1
        if t > rest + _AFTER:
            break
        _advance(p, s, t, step)
        steps += 1
        if t >= p.onset and s[_V] <= _STANDSTILL and math.isinf(rest):
            rest = t + step
    rows[k:], turns[k:] = rows[k - 1], turns[k - 1]
    return rows, turns, rest, s[_HEAT]
