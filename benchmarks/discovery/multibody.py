"""A car that somebody else wrote, with brakes and effects put on from outside.

Chassis, springs and tyres are CommonRoad's multi-body model (:mod:`.vehicle_models`): Pacejka's
tyre, load transfer, a body that dives and leans. Added here are torques at the wheels (hydraulic
brakes, drive, rolling, driveline) and accelerations of the bodies (gravity along grade and roll,
air). None of the effects is a term of a braking model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from .physics import Floats, Stops
from .plant import GRAVITY, DrivenStops
from .vehicle_models import CAR, WHEELS, car_slopes, loaded, on_ground, rolling_state

BEFORE = 1.2
"""Of each stop that is logged before its command [s]."""

SHARPEST = 0.05
"""Curvature beyond which this car is not steered [1/m]."""

_SAMPLE = 0.02  # [s]
_SETTLE = 0.5  # [s] at speed before anything is logged
_LONGEST = 8.0  # [s]
_STEP, _STEP_BY_SPEED = 1e-3, 3e-4  # [s], [s per m/s]: wheels are the stiffer the slower they roll
_CRAWL = 0.12  # [m/s] below about 0.1 the package has no tyre forces; the rest is extrapolated
_SWINGS_BACK = 0.15  # [s] the body after standstill
_GAIN = 15.0  # [1/s] of the speed controller
_PACKAGE_GRAVITY = 9.81
_AREAS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class CarNature:
    """What is so in this world; the defaults are a car without any effect.

    Attributes:
        brake: torque of all wheels at the rims as a share of the dry weight, on level ground.
        assist: that share per grade [1/rad]; brakes that sense the slope press harder downhill.
        front: share of the front axle. resistance: of rolling, share of the dry weight.
        friction: of the tyres' peak on loose ground, 0 for the road.
        delay: until the brakes are told [s]. build_up: each of two lags of their pressure [s].
        payload: [kg] from run ``payload_run`` on. repair: factor on the brakes from that run on.
        air: force on the body per relative air speed squared [N s²/m²]; wind [m/s] blows against
            whoever heads towards ``wind_from`` [rad].
        driveline: viscous torque of each wheel [N m s].
        fading: share of the brakes that heat takes at most, all but 1/e of it at ``hot`` [J/kg].
        cooling: [s]. glazing: share of the brakes lost per second of the session.
        furrows: resistance added across them at most, none along, share of the dry weight;
            ``furrows_along`` [rad] is the heading of most resistance.
        slippery: x, y, radius [m] and friction of areas, two at most.
    """

    brake: float = 0.42
    assist: float = -0.08
    front: float = 0.66
    resistance: float = 0.02
    friction: float = 0.0
    delay: float = 0.16
    build_up: float = 0.015
    payload: float = 0.0
    repair: float = 1.0
    payload_run: int = 10**9
    air: float = 0.0
    wind: float = 0.0
    wind_from: float = 0.0
    driveline: float = 0.0
    fading: float = 0.0
    hot: float = 20.0
    cooling: float = 150.0
    glazing: float = 0.0
    furrows: float = 0.0
    furrows_along: float = 0.0
    slippery: tuple[tuple[float, float, float, float], ...] = ()


class _Push(NamedTuple):
    """What is put on the car during one stop, SI; torques of all wheels together [N m]."""

    speed: float
    grade: float
    wave: float
    wave_length: float
    wave_phase: float
    roll: float
    told: float
    build_up: float
    brake: float
    assist: float
    front: float
    rolling: float
    furrows: float
    furrows_along: float
    driveline: float
    air: float
    wind: float
    wind_from: float
    fading: float
    hot: float
    cooling: float
    step: float


class _Traces(NamedTuple):
    """Of one stop, (samples, 9): speed, station, x, y, yaw, yaw rate, grade, pitch, roll."""

    rows: Floats
    rest: float
    distance: float
    deceleration: float
    heat: float


def drive(nature: CarNature, stops: Stops, finer: float = 1.0) -> DrivenStops:
    """All stops in their order, sampled at 50 Hz from :data:`BEFORE` the command on.

    Args:
        nature: of the world. stops: what is driven.
        finer: divides the steps of the integration.
    """
    count = np.arange(-round(BEFORE / _SAMPLE), round(_LONGEST / _SAMPLE))
    time: Floats = np.asarray(count * _SAMPLE, np.float64)
    heat, since, found = 0.0, 0.0, []
    for i in range(len(stops.speed)):
        clock = float(stops.clock[i])
        heat *= math.exp(-(clock - since) / nature.cooling)
        found.append(_one(nature, stops, i, heat, time, finer))
        heat, since = found[-1].heat, clock + min(found[-1].rest, _LONGEST)
    rows = np.stack([trace.rows for trace in found])
    speed, station, x, y, yaw, rate, grade, pitch, roll = np.moveaxis(rows, 2, 0)
    rest = np.array([trace.rest for trace in found])
    swing = np.exp(-np.maximum(time - rest[:, None], 0.0) / _SWINGS_BACK)
    return DrivenStops(
        time, speed, station, x, y, yaw, rate, grade + swing * pitch,
        stops.roll[:, None] + roll, rest, np.array([trace.distance for trace in found]),
        np.array([trace.deceleration for trace in found]),
    )  # fmt: skip


def _one(
    nature: CarNature, stops: Stops, i: int, heat: float, time: Floats, finer: float
) -> _Traces:
    late = i >= nature.payload_run
    car = loaded(nature.payload if late else 0.0)
    areas = (*nature.slippery, *[(0.0, 0.0, -1.0, 0.0)] * _AREAS)[:_AREAS]
    grounds = (on_ground(car, nature.friction), *(on_ground(car, area[3]) for area in areas))
    curvature = float(np.clip(stops.curvature[i], -SHARPEST, SHARPEST))
    speed, heading = float(stops.speed[i]), float(stops.heading[i])
    begun = -(BEFORE + _SETTLE)
    back = begun * speed
    # The package's y and yaw are to the right.
    steer = math.atan(-curvature * (car.a + car.b))
    state = rolling_state(car, speed, -(heading + curvature * back), steer, -curvature)
    bend = curvature if abs(curvature) > 1e-9 else 1e-9
    state[0] = stops.x[i] + (math.sin(heading + bend * back) - math.sin(heading)) / bend
    state[1] = -stops.y[i] + (math.cos(heading + bend * back) - math.cos(heading)) / bend
    return _Traces(*_stop(
        state, grounds, np.array([area[:3] for area in areas]),
        _push(nature, stops, i, late, finer), heat, time, begun, back,
    ))  # fmt: skip


def _push(nature: CarNature, stops: Stops, i: int, late: bool, finer: float) -> _Push:
    torque = CAR.m * GRAVITY * CAR.R_w
    strength = float(stops.friction[i]) * (1.0 - nature.glazing * float(stops.clock[i]))
    strength *= nature.repair if late else 1.0
    return _Push(
        float(stops.speed[i]), float(stops.grade[i]), float(stops.wave[i]),
        float(stops.wave_length[i]), float(stops.wave_phase[i]), float(stops.roll[i]),
        nature.delay + float(stops.delay[i]), nature.build_up,
        torque * nature.brake * strength, torque * nature.assist * strength, nature.front,
        torque * nature.resistance, torque * nature.furrows, nature.furrows_along,
        nature.driveline, nature.air, nature.wind, nature.wind_from,
        nature.fading, nature.hot, nature.cooling, 1.0 / finer,
    )  # fmt: skip


@njit(cache=False)
def _grade(push: _Push, station: float) -> float:
    turn = 2.0 * math.pi * station / push.wave_length + push.wave_phase
    return push.grade + push.wave * math.sin(turn)


@njit(cache=False)
def _brake(push: _Push, t: float, grade: float, heat: float) -> float:
    """Torque of all wheels: pressure builds up by two equal lags, pads lose by heat."""
    late = (t - push.told) / push.build_up
    pressure = 1.0 - (1.0 + late) * math.exp(-late) if late > 0.0 else 0.0
    lost = push.fading * (1.0 - math.exp(-heat / push.hot))
    return max(push.brake + push.assist * grade, 0.0) * pressure * (1.0 - lost)


@njit(cache=False)
def _slopes(
    state: Floats, t: float, grade: float, brake: float, push: _Push, car: Any
) -> Floats:  # fmt: skip
    """The package's derivatives, with what is put on from outside."""
    f = np.array(car_slopes(state, np.zeros(2), car))
    yaw = -state[4]
    ahead = state[3] + push.wind * math.cos(yaw - push.wind_from)
    f[3] -= GRAVITY * math.sin(grade) + push.air * abs(ahead) * ahead / car.m
    aside = GRAVITY * math.cos(grade) * math.sin(push.roll)
    down = GRAVITY * math.cos(grade) * math.cos(push.roll) - _PACKAGE_GRAVITY
    for k in (10, 15, 20):
        f[k] += aside
    for k in (12, 17, 22):
        f[k] += down
    rolling = push.rolling + push.furrows * 0.5 * (1.0 + math.cos(2.0 * (yaw - push.furrows_along)))
    driving = 0.0
    if t < push.told:
        force = car.m * (_GAIN * (push.speed - state[3]) + GRAVITY * math.sin(grade))
        driving = force * car.R_w + rolling
    for k in range(WHEELS.start, WHEELS.stop):
        share = 0.5 * (push.front if k < WHEELS.start + 2 else 1.0 - push.front)
        torque = 0.25 * (driving - rolling) - share * brake - push.driveline * state[k]
        f[k] += torque / car.I_y_w
        # Brakes hold a wheel; they do not turn it back.
        if state[k] <= 0.0 and f[k] < 0.0:
            f[k] = 0.0
    return f


@njit(cache=False)
def _ground(areas: Floats, x: float, y: float) -> int:
    """Number of the slippery area that is here, counted from 1; 0 for none."""
    for k in range(len(areas)):
        if areas[k, 2] > 0.0 and math.hypot(x - areas[k, 0], y - areas[k, 1]) <= areas[k, 2]:
            return k + 1
    return 0


@njit(cache=False)
def _stepped(
    state: Floats, t: float, h: float, grade: float, heat: float, push: _Push, car: Any
) -> Floats:
    """One step by Runge and Kutta."""
    half, whole = t + 0.5 * h, t + h
    middle = _brake(push, half, grade, heat)
    a = _slopes(state, t, grade, _brake(push, t, grade, heat), push, car)
    b = _slopes(state + 0.5 * h * a, half, grade, middle, push, car)
    c = _slopes(state + 0.5 * h * b, half, grade, middle, push, car)
    d = _slopes(state + h * c, whole, grade, _brake(push, whole, grade, heat), push, car)
    found: Floats = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    found[WHEELS] = np.maximum(found[WHEELS], 0.0)
    return found


@njit(cache=False)
def _stop(
    state: Floats, grounds: Any, areas: Floats, push: _Push, heat: float, time: Floats,
    begun: float, back: float,
) -> tuple[Floats, float, float, float, float]:  # fmt: skip
    rows = np.empty((len(time), 9))
    t, s, k, slowing = begun, back, 0, 0.0
    while k < len(time):
        grade = _grade(push, s)
        if t >= time[k] - 1e-9:
            yaw = -state[4]
            rows[k] = (
                state[3], s, state[0], -state[1], yaw, -state[5], grade, state[8], state[6],
            )  # fmt: skip
            k += 1
            continue
        v = state[3]
        if v < _CRAWL:
            break
        car = grounds[_ground(areas, state[0], -state[1])]
        h = min(_STEP, _STEP_BY_SPEED * v) * push.step
        h = min(h, time[k] - t)
        brake = _brake(push, t, grade, heat)
        spin = state[WHEELS]
        front = push.front * 0.5 * (spin[0] + spin[1])
        power = brake * (front + (1.0 - push.front) * 0.5 * (spin[2] + spin[3]))
        heat += h * (power / car.m - heat / push.cooling)
        state = _stepped(state, t, h, grade, heat, push, car)
        slowing = (v - state[3]) / h
        s, t = s + 0.5 * h * (v + state[3]), t + h
    if k == len(time) or slowing <= 0.0:
        rows[k:] = rows[k - 1]
        return rows, np.inf, np.inf, 0.0, heat
    # From here on as it was last, to standstill.
    v, left = state[3], state[3] / slowing
    last = rows[k - 1].copy()
    last[5] = 0.0
    for j in range(k, len(time)):
        since = min(time[j] - t, left)
        rows[j] = last
        rows[j, 0] = v - slowing * since
        rows[j, 1] = s + v * since - 0.5 * slowing * since**2
        way = rows[j, 1] - last[1]
        rows[j, 2] += way * math.cos(last[4])
        rows[j, 3] += way * math.sin(last[4])
    return rows, t + left, s + 0.5 * v * left, slowing, heat
