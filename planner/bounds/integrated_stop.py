"""Highest speed from which the vehicle can still stop, found by trial, stop by stop.

The bound for candidates along which an effect acts on the motion itself, or a load may run short
on the way: there the closed form does not hold, or does not know of the load.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.pointwise import PointwiseBounds
from slopewise.planner.bounds.stopping_path import (
    OVERRUN,
    REAR_LOAD,
    SIDE_LOAD,
    STOPPED,
    StopConditions,
    StopPath,
    StopProblem,
    integrate_stop,
)
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.limiting import Limiting

_TRIALS = 40
"""Brackets of the speed at most [1]: bisection alone reaches 1e-12 of the first bracket."""
_GUESSES = 8
"""Trials that are guessed from where stops end; then, and where loads decide, they bisect."""

_SPEED_ERROR = 1e-6
"""How close below the highest speed a trial is good enough [m/s]."""

_STOP_ERROR = 1e-7
"""How close before the target a stop is good enough [m]."""

_COLUMNS = len(StopPath._fields)
_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)


@kernel
def integrated_bound(
    chosen: Ints,
    problem: StopProblem,
    everywhere: bool,
    motion: MotionTerms,
    limits: PlanningLimits,
    bounds: PointwiseBounds,
) -> None:
    """Lower bounds to speeds whose integrated stop ends before the target, loads kept.

    Args:
        chosen: indices of the candidates that need it.
        problem: terrain, forces and targets of all candidates.
        everywhere: False where the closed form holds already, and only loads are looked after.
        motion: effects.
        limits: of the model.
        bounds: v² and its labels are lowered in place; those <= 0 stay.
    """
    columns = np.empty((_COLUMNS, problem.terrain.station.shape[0]))
    for j in chosen:
        path = _path_of(j, problem, columns)
        last = path.station.shape[0] if everywhere else bounds.last_risk[j] + 1
        watched = np.inf if everywhere else path.station[min(last, path.station.shape[0] - 1)]
        conditions = StopConditions(
            problem.target[j],
            motion,
            limits.rear_lever,
            limits.front_lever,
            limits.side_lever,
            limits.min_load,
            problem.height,
            watched,
        )
        for k in range(last):
            bound = bounds.speed_sq_max[k, j]
            if bound <= 0.0:
                continue
            speed, why = _highest_stop(k, np.sqrt(bound), path, conditions)
            if why != STOPPED:
                bounds.speed_sq_max[k, j] = speed * speed
                bounds.limiting[k, j] = _label(why)


@kernel
def _path_of(j: int, problem: StopProblem, columns: Floats) -> StopPath:
    """Candidate j without padding, as views of ``columns``."""
    terrain, forces = problem.terrain, problem.forces
    n = terrain.counts[j]
    path = StopPath(
        columns[0, :n],
        columns[1, :n],
        columns[2, :n],
        columns[3, :n],
        columns[4, :n],
        columns[5, :n],
        columns[6, :n],
        columns[7, :n],
        columns[8, :n],
        columns[9, :n],
        columns[10, :n],
        columns[11, :n],
        columns[12, :n],
        columns[13, :n],
        columns[14, :n],
    )
    for k in range(n):
        sin_grade, sin_roll = terrain.sin_grade[k, j], terrain.sin_roll[k, j]
        curvature = terrain.curvature[k, j]
        cosine = np.sqrt(1.0 - sin_grade * sin_grade)
        cos_lean = np.sqrt(1.0 - sin_roll * sin_roll)
        bend, bank = abs(curvature), cosine * sin_roll
        path.station[k], path.grade[k] = terrain.station[k, j], terrain.grade[k, j]
        path.sin_grade[k] = sin_grade
        path.lower_slope[k] = forces.lower_slope[k, j]
        path.lower_intercept[k] = forces.lower_intercept[k, j]
        path.upper_slope[k] = forces.upper_slope[k, j]
        path.upper_intercept[k] = forces.upper_intercept[k, j]
        path.dead_time[k], path.slowest[k] = forces.dead_time[k, j], forces.slowest[k, j]
        path.upright[k] = cosine * cos_lean
        path.tilt[k] = bank if curvature > 0.0 else -bank
        path.lean[k] = bend / (GRAVITY * cos_lean)
        path.falls[k] = max(-terrain.vertical_curvature[k, j], 0.0) / GRAVITY
        path.bend[k] = bend
        yaw = np.arctan2(terrain.heading_y[k, j], terrain.heading_x[k, j])
        turned = yaw - path.yaw[k - 1] if k > 0 else 0.0
        path.yaw[k] = yaw - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
    return path


@inlined
def _label(ending: int) -> int:
    """What limits the speed where stops from higher ones end like that."""
    if ending == REAR_LOAD:
        return _TIP_OVER
    return _ROLLOVER if ending == SIDE_LOAD else _STOPPING_PATH


@inlined
def _highest_stop(
    k: int, high: float, path: StopPath, conditions: StopConditions
) -> tuple[float, int]:
    """Highest speed up to ``high`` whose stop ends well, and how those from above it end."""
    target, dead_time = conditions.target, path.dead_time[k]
    low, why = 0.0, STOPPED
    before, beyond_before = 0.0, path.station[k] - target
    trial = high
    for step in range(_TRIALS):
        how, where, _ = integrate_stop(k, trial, path, conditions)
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

    Between them the distance grows as dead time * v + c v².
    """
    c = (beyond_1 - beyond_0 - dead_time * (v_1 - v_0)) / (v_1 * v_1 - v_0 * v_0)
    distance = c * v_1 * v_1 + dead_time * v_1 - beyond_1 - 0.5 * _STOP_ERROR
    root = dead_time * dead_time + 4.0 * c * distance
    return float(2.0 * distance / (dead_time + np.sqrt(root))) if root > 0.0 else 0.0
