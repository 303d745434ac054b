"""A car of another author, with brakes and effects added from outside.

Chassis, springs and tyres are CommonRoad's multi-body model (:mod:`.vehicle_models`): Pacejka's
tyre, load transfer, a body that pitches and rolls. Added here are torques at the wheels (hydraulic
brakes, drive, rolling, driveline) and accelerations of the bodies (gravity along grade and roll,
air). None of the effects is a term of a braking model.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from .effect_plant import GRAVITY, DrivenStops
from .plant_physics import Floats, Stops
from .vehicle_models import CAR, WHEELS, car_slopes, loaded, on_ground, rolling_state

_STEP, _STEP_BY_SPEED = 1e-3, 3e-4  # [s], [s per m/s]: wheels are the stiffer the slower they roll
_MIN_SPEED = 0.12  # [m/s]; below about 0.1 the package has no tyre forces: extrapolated
_GAIN = 15.0  # [1/s] of the speed controller
_PACKAGE_GRAVITY = 9.81  # [m/s²]


_OF_STOP = ("speed", "grade", "wave", "wave_length", "wave_phase", "roll")
_OF_CAR = ("build_up", "front", "furrows_along", "driveline", "air", "wind", "wind_from")
_OF_HEAT = ("fading", "hot", "cooling")


def _push_type() -> Any:
    forces = ("onset", "brake", "assist", "rolling", "furrows", "step")
    return namedtuple("CarPush", (*_OF_STOP, *_OF_CAR, *_OF_HEAT, *forces))


CarPush = _push_type()
"""External forces during one stop, SI: fields of stops and :class:`CarNature`, time of the onset,
torques of all wheels together [N m], step of the integration over the usual one."""


@njit(cache=False)
def _grade(push: Any, station: float) -> float:
    turn = 2.0 * math.pi * station / push.wave_length + push.wave_phase
    grade: float = push.grade + push.wave * math.sin(turn)
    return grade


@njit(cache=False)
def _brake(push: Any, t: float, grade: float, heat: float) -> float:
    """Torque of all wheels: pressure builds up by two equal lags, pads lose by heat."""
    late = (t - push.onset) / push.build_up
    pressure = 1.0 - (1.0 + late) * math.exp(-late) if late > 0.0 else 0.0
    lost = push.fading * (1.0 - math.exp(-heat / push.hot))
    torque: float = max(push.brake + push.assist * grade, 0.0) * pressure * (1.0 - lost)
    return torque


@njit(cache=False)
def _slopes(state: Floats, t: float, grade: float, brake: float, push: Any, car: Any) -> Floats:
    """The package's derivatives with external forces."""
    f = np.array(car_slopes(state, np.zeros(2), car))
    yaw = -state[4]
    ahead = state[3] + push.wind * math.cos(yaw - push.wind_from)
    f[3] -= GRAVITY * math.sin(grade) + push.air * abs(ahead) * ahead / car.m
    lateral = GRAVITY * math.cos(grade) * math.sin(push.roll)
    down = GRAVITY * math.cos(grade) * math.cos(push.roll) - _PACKAGE_GRAVITY
    for k in (10, 15, 20):
        f[k] += lateral
    for k in (12, 17, 22):
        f[k] += down
    rolling = push.rolling + push.furrows * 0.5 * (1.0 + math.cos(2.0 * (yaw - push.furrows_along)))
    driving = 0.0
    if t < push.onset:
        force = car.m * (_GAIN * (push.speed - state[3]) + GRAVITY * math.sin(grade))
        driving = force * car.R_w + rolling
    for k in range(WHEELS.start, WHEELS.stop):
        share = 0.5 * (push.front if k < WHEELS.start + 2 else 1.0 - push.front)
        torque = 0.25 * (driving - rolling) - share * brake - push.driveline * state[k]
        f[k] += torque / car.I_y_w
        # Brakes hold a wheel and never turn it backwards.
        if state[k] <= 0.0 and f[k] < 0.0:
            f[k] = 0.0
    return f


@njit(cache=False)
def _ground(areas: Floats, x: float, y: float) -> int:
    """Number of the slippery area at a place, counted from 1; 0 for none."""
    for k in range(len(areas)):
        if areas[k, 2] > 0.0 and math.hypot(x - areas[k, 0], y - areas[k, 1]) <= areas[k, 2]:
            return k + 1
    return 0


@njit(cache=False)
def _stepped(
    state: Floats, t: float, h: float, grade: float, heat: float, push: Any, car: Any
) -> Floats:
    """Advance by one Runge–Kutta step."""
    half, end = t + 0.5 * h, t + h
    middle = _brake(push, half, grade, heat)
    a = _slopes(state, t, grade, _brake(push, t, grade, heat), push, car)
    b = _slopes(state + 0.5 * h * a, half, grade, middle, push, car)
    c = _slopes(state + 0.5 * h * b, half, grade, middle, push, car)
    d = _slopes(state + h * c, end, grade, _brake(push, end, grade, heat), push, car)
    stepped: Floats = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    stepped[WHEELS] = np.maximum(stepped[WHEELS], 0.0)
    return stepped


@njit(cache=False)
def stop_car(
    state: Floats,
    grounds: Any,
    areas: Floats,
    push: Any,
    heat: float,
    time: Floats,
    start: float,
    back: float,
) -> tuple[Floats, float, float, float, float]:
    """Drive one stop, first at constant speed from time ``start`` [s] and station ``back`` [m].

    The command is at time and station 0. ``grounds`` are parameters of the car on the road and on
    each of the areas (x, y, radius) [m], ``heat`` is in the brakes [J/kg], ``time`` that of rows.

    Returns:
        Rows of speed, station, x, y, yaw, yaw rate, grade, pitch, roll, shape (samples, 9); time of
        rest [s] and distance [m], inf without standstill; deceleration before rest [m/s²]; heat.
    """
    rows = np.empty((len(time), 9))
    t, s, k, decel = start, back, 0, 0.0
    while k < len(time):
        grade = _grade(push, s)
        if t >= time[k] - 1e-9:
            place = (state[3], s, state[0], -state[1])
            rows[k] = (*place, -state[4], -state[5], grade, state[8], state[6])
            k += 1
            continue
        v = state[3]
        if v < _MIN_SPEED:
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
        decel = (v - state[3]) / h
        s, t = s + 0.5 * h * (v + state[3]), t + h
    if k == len(time) or decel <= 0.0:
        rows[k:] = rows[k - 1]
        return rows, np.inf, np.inf, 0.0, heat
    # Constant deceleration from here to standstill.
    v, left = state[3], state[3] / decel
    last = rows[k - 1].copy()
    last[5] = 0.0
    for j in range(k, len(time)):
        since = min(time[j] - t, left)
        rows[j] = last
        rows[j, 0] = v - decel * since
        rows[j, 1] = s + v * since - 0.5 * decel * since**2
        distance = rows[j, 1] - last[1]
        rows[j, 2] += distance * math.cos(last[4])
        rows[j, 3] += distance * math.sin(last[4])
    return rows, t + left, s + 0.5 * v * left, decel, heat


BEFORE = 1.2  # Logged time before each command [s]
MAX_CURVATURE = 0.05  # Curvature up to which this car is steered [1/m]
_SAMPLE = 0.02  # [s], as of :mod:`.sensing`
_SETTLE = 0.5  # [s] at speed before the log begins
_MAX_STOP = 8.0  # [s]
_BODY_RETURN = 0.15  # [s] time constant of the body's attitude after standstill
_AREAS = 2  # slippery ones at most


@dataclass(frozen=True, slots=True, kw_only=True)
class CarNature:
    """True parameters of this world; the defaults are a car without effects."""

    brake: float = 0.42  # torque of all wheels at the rims over the dry weight, on level ground [1]
    # that share per grade [1/rad]; brakes that sense the slope press harder downhill
    assist: float = -0.08
    front: float = 0.66  # brake share of the front axle [1]
    resistance: float = 0.02  # rolling resistance over the dry weight [1]
    friction: float = 0.0  # peak friction of the tyres on loose ground, 0 for the road [1]
    delay: float = 0.16  # dead time of the command [s]
    build_up: float = 0.015  # each of two lags of the brake pressure [s]
    # [kg] from run ``payload_run`` on. repair: factor on the brakes from that run on
    payload: float = 0.0
    repair: float = 1.0
    payload_run: int = 10**9
    # force on the body per relative air speed squared [N s²/m²]; wind [m/s] blows against a vehicle
    # that heads towards ``wind_from`` [rad]
    air: float = 0.0
    wind: float = 0.0
    wind_from: float = 0.0
    driveline: float = 0.0  # viscous torque of each wheel [N m s]
    # largest share of the brakes lost by heat [1], 1 − 1/e of it at ``hot`` [J/kg]
    fading: float = 0.0
    hot: float = 20.0
    cooling: float = 150.0  # time constant of that heat [s]
    glazing: float = 0.0  # share of the brakes lost per second of the session [1/s]
    # resistance across them over the dry weight, none along [1]; ``furrows_along`` is the heading
    # of the largest resistance [rad]
    furrows: float = 0.0
    furrows_along: float = 0.0
    # x, y, radius [m] and friction [1] of areas, two at most
    slippery: tuple[tuple[float, float, float, float], ...] = ()


def drive(nature: CarNature, stops: Stops, finer: float = 1.0) -> DrivenStops:
    """Drive all stops in their order, sampled at 50 Hz from :data:`BEFORE` each command.

    ``finer`` divides the steps of the integration.
    """
    count = np.arange(-round(BEFORE / _SAMPLE), round(_MAX_STOP / _SAMPLE))
    time: Floats = np.asarray(count * _SAMPLE, np.float64)
    heat, since = 0.0, 0.0
    traces = []
    for i in range(len(stops.speed)):
        clock = float(stops.clock[i])
        heat *= math.exp(-(clock - since) / nature.cooling)
        *trace, heat = _drive_stop(nature, stops, i, heat, time, finer)
        traces.append(trace)
        since = clock + min(trace[1], _MAX_STOP)
    rows, *ends = zip(*traces, strict=True)
    speed, station, x, y, yaw, rate, grade, pitch, roll = np.moveaxis(np.stack(rows), 2, 0)
    rest, distance, last = np.array(ends)
    swing = np.exp(-np.maximum(time - rest[:, None], 0.0) / _BODY_RETURN)
    attitude = (grade + swing * pitch, stops.roll[:, None] + roll)
    return DrivenStops(time, speed, station, x, y, yaw, rate, *attitude, rest, distance, last)


def _drive_stop(
    nature: CarNature, stops: Stops, i: int, heat: float, time: Floats, finer: float
) -> Any:
    """Rows, time of rest, distance, deceleration and heat of one stop, as of :func:`stop_car`."""
    late = i >= nature.payload_run
    car = loaded(nature.payload if late else 0.0)
    areas = (*nature.slippery, *[(0.0, 0.0, -1.0, 0.0)] * _AREAS)[:_AREAS]
    grounds = (on_ground(car, nature.friction), *(on_ground(car, area[3]) for area in areas))
    curvature = float(np.clip(stops.curvature[i], -MAX_CURVATURE, MAX_CURVATURE))
    speed, heading = float(stops.speed[i]), float(stops.heading[i])
    start = -(BEFORE + _SETTLE)
    back = start * speed
    # The package's y and yaw are to the right.
    steer = math.atan(-curvature * (car.a + car.b))
    state = rolling_state(car, speed, -(heading + curvature * back), steer, -curvature)
    turn = curvature if abs(curvature) > 1e-9 else 1e-9
    state[0] = stops.x[i] + (math.sin(heading + turn * back) - math.sin(heading)) / turn
    state[1] = -stops.y[i] + (math.cos(heading + turn * back) - math.cos(heading)) / turn
    push = _push(nature, stops, i, late, finer)
    return stop_car(state, grounds, np.array([a[:3] for a in areas]), push, heat, time, start, back)


def _push(nature: CarNature, stops: Stops, i: int, late: bool, finer: float) -> Any:
    torque = CAR.m * GRAVITY * CAR.R_w
    strength = float(stops.friction[i]) * (1.0 - nature.glazing * float(stops.clock[i]))
    strength *= nature.repair if late else 1.0
    return CarPush(
        **{name: float(getattr(stops, name)[i]) for name in _OF_STOP},
        onset=nature.delay + float(stops.delay[i]),
        brake=torque * nature.brake * strength,
        assist=torque * nature.assist * strength,
        rolling=torque * nature.resistance,
        furrows=torque * nature.furrows,
        step=1.0 / finer,
        **{name: getattr(nature, name) for name in (*_OF_CAR, *_OF_HEAT)},
    )
