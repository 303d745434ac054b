"""Highest speed from which the vehicle can still stop, found by trial, stop by stop.

For candidates along which an effect acts on the motion itself, or a load may run short on the way.
"""

from __future__ import annotations

import numpy as np

from models.effects.registry import Motion
from planner.bounds.pointwise import side_reach
from planner.bounds.stopping_path import (
    OVERRUN,
    REAR_LOAD,
    SIDE_LOAD,
    STOPPED,
    StopPath,
    integrate_stop,
)
from planner.kernels.compiled import Floats, Ints, inlined, kernel
from planner.kernels.limits import PlanningLimits
from planner.limiting import Limiting

_TRIALS = 40
_GUESSES = 8
"""Trials that are guessed from where stops end; then, and where loads decide, they bisect."""

_SPEED_ERROR = 1e-6
"""How close below the highest speed a trial is good enough [m/s]."""

_STOP_ERROR = 1e-7
"""How close before the target a stop is good enough [m]."""

_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)


@kernel
def integrated_bound(
    chosen: Ints, target: Floats, count: Ints,
    station: Floats, grade: Floats, sin_grade: Floats, sin_roll: Floats, curvature: Floats,
    heading_x: Floats, heading_y: Floats,
    lower_slope: Floats, lower_intercept: Floats, upper_slope: Floats, upper_intercept: Floats,
    slowest: Floats, dead_time: Floats, motion: Motion, n: PlanningLimits,
    speed_sq_max: Floats, limiting: Ints,
) -> None:  # fmt: skip
    """Lower ``speed_sq_max`` to speeds whose integrated stop ends before the target, loads kept.

    Args:
        chosen: indices of the candidates that need it.
        target: (M,) the vehicle must stand here [m]; count: (M,) stations.
        station, grade, sin_grade, sin_roll, curvature, heading_x, heading_y: (N, M) terrain.
        lower_slope, lower_intercept, upper_slope, upper_intercept, slowest, dead_time: (N, M)
            ground.
        motion: effects; n: the model.
        speed_sq_max, limiting: (N, M) bounds so far, lowered in place; those <= 0 stay.
    """
    stations = station.shape[0]
    path = StopPath(
        np.empty(stations), np.empty(stations), np.empty(stations), np.empty(stations),
        np.empty(stations), np.empty(stations), np.empty(stations), np.empty(stations),
        np.empty(stations), np.empty(stations), np.empty(stations),
    )  # fmt: skip
    for j in chosen:
        for k in range(count[j]):
            cosine = np.sqrt(1.0 - sin_grade[k, j] * sin_grade[k, j])
            cos_lean = np.sqrt(1.0 - sin_roll[k, j] * sin_roll[k, j])
            bend = abs(curvature[k, j])
            reach = side_reach(curvature[k, j], sin_roll[k, j], cosine, cos_lean, n)
            path.station[k] = station[k, j]
            path.grade[k] = grade[k, j]
            path.sin_grade[k] = sin_grade[k, j]
            path.lower_slope[k] = lower_slope[k, j]
            path.lower_intercept[k] = lower_intercept[k, j]
            path.upper_slope[k] = upper_slope[k, j]
            path.upper_intercept[k] = upper_intercept[k, j]
            path.upright[k] = cosine * cos_lean
            path.side_speed_sq[k] = reach / bend if bend > 0.0 else np.inf
            path.bend[k] = bend
            yaw = np.arctan2(heading_y[k, j], heading_x[k, j])
            path.yaw[k] = yaw
            if k > 0:
                turned = yaw - path.yaw[k - 1]
                path.yaw[k] = yaw - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
        for k in range(count[j]):
            bound = speed_sq_max[k, j]
            if bound <= 0.0:
                continue
            speed, why = _highest_stop(
                k, np.sqrt(bound), target[j], count[j], path, slowest[k, j], dead_time[k, j],
                motion, n,
            )  # fmt: skip
            if why != STOPPED:
                speed_sq_max[k, j] = speed * speed
                limiting[k, j] = _label(why)


@inlined
def _label(ending: int) -> int:
    """What limits the speed where stops from higher ones end like that."""
    if ending == REAR_LOAD:
        return _TIP_OVER
    return _ROLLOVER if ending == SIDE_LOAD else _STOPPING_PATH


@inlined
def _highest_stop(
    k: int, high: float, target: float, count: int, path: StopPath, slowest: float,
    dead_time: float, motion: Motion, n: PlanningLimits,
) -> tuple[float, int]:  # fmt: skip
    """Highest speed up to ``high`` whose stop ends well, and how those from above it end."""
    low, why = 0.0, STOPPED
    before, beyond_before = 0.0, path.station[k] - target
    trial = high
    for step in range(_TRIALS):
        how, where, _ = integrate_stop(
            k, trial, target, count, path, slowest, dead_time, motion, n.rear_lever, n.min_load
        )
        beyond = where - target
        if how == STOPPED:
            low = trial
            if step == 0 or beyond > -_STOP_ERROR:
                break
        else:
            high, why = trial, how
        if high - low < _SPEED_ERROR:
            break
        guess = 0.5 * (low + high)
        if how <= OVERRUN and step < _GUESSES:
            meeting = _meeting(before, trial, beyond_before, beyond, dead_time)
            guess = meeting if low < meeting < high else guess
        before, beyond_before = trial, beyond
        trial = guess
    return low, why


@inlined
def _meeting(v_0: float, v_1: float, beyond_0: float, beyond_1: float, dead_time: float) -> float:
    """Speed whose stop ends close before the target, from two stops and how far beyond they end.

    Between them the way grows as dead time * v + c v².
    """
    c = (beyond_1 - beyond_0 - dead_time * (v_1 - v_0)) / (v_1 * v_1 - v_0 * v_0)
    way = c * v_1 * v_1 + dead_time * v_1 - beyond_1 - 0.5 * _STOP_ERROR
    root = dead_time * dead_time + 4.0 * c * way
    return float(2.0 * way / (dead_time + np.sqrt(root))) if root > 0.0 else 0.0
