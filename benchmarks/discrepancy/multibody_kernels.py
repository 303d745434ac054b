"""One stop of the multi-body car, step by step: the package's slopes with external forces."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from .effect_plant import GRAVITY
from .plant_physics import Floats
from .vehicle_models import WHEELS, car_slopes

_STEP, _STEP_BY_SPEED = 1e-3, 3e-4  # [s], [s per m/s]: wheels are the stiffer the slower they roll
_MIN_SPEED = 0.12  # [m/s]; below about 0.1 the package has no tyre forces: extrapolated
_GAIN = 15.0  # [1/s] of the speed controller
_PACKAGE_GRAVITY = 9.81  # [m/s²]


class CarPush(NamedTuple):
    """External forces during one stop, SI; torques of all wheels together [N m]."""

    speed: float
    grade: float
    wave: float
    wave_length: float
    wave_phase: float
    roll: float
    onset: float
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


@njit(cache=False)
def _grade(push: CarPush, station: float) -> float:
    turn = 2.0 * math.pi * station / push.wave_length + push.wave_phase
    return push.grade + push.wave * math.sin(turn)


@njit(cache=False)
def _brake(push: CarPush, t: float, grade: float, heat: float) -> float:
    """Torque of all wheels: pressure builds up by two equal lags, pads lose by heat."""
    late = (t - push.onset) / push.build_up
    pressure = 1.0 - (1.0 + late) * math.exp(-late) if late > 0.0 else 0.0
    lost = push.fading * (1.0 - math.exp(-heat / push.hot))
    return max(push.brake + push.assist * grade, 0.0) * pressure * (1.0 - lost)


@njit(cache=False)
def _slopes(state: Floats, t: float, grade: float, brake: float, push: CarPush, car: Any) -> Floats:
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
    state: Floats, t: float, h: float, grade: float, heat: float, push: CarPush, car: Any
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
    push: CarPush,
    heat: float,
    time: Floats,
    start: float,
    back: float,
) -> tuple[Floats, float, float, float, float]:
    """Drive one stop, first at constant speed.

    Args:
        state: state at time ``start`` [s] and station ``back`` [m], shape (29,); the command is at
            time and station 0.
        grounds: parameters of the car on the road and on each area.
        areas: x, y, radius, shape (n, 3) [m].
        push: external forces.
        heat: heat in the brakes [J/kg].
        time: times of the rows, shape (samples,) [s].

    Returns:
        Rows of speed, station, x, y, yaw, yaw rate, grade, pitch, roll, shape (samples, 9); time of
        rest [s] and distance [m], inf without standstill; deceleration before rest [m/s²]; heat
        [J/kg].
    """
    rows = np.empty((len(time), 9))
    t, s, k, decel = start, back, 0, 0.0
    while k < len(time):
        grade = _grade(push, s)
        if t >= time[k] - 1e-9:
            yaw = -state[4]
            rows[k] = (
                state[3],
                s,
                state[0],
                -state[1],
                yaw,
                -state[5],
                grade,
                state[8],
                state[6],
            )
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
