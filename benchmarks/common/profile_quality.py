"""Travel time and limit violation of a speed profile, the same measure for every solver."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.profile.problems import SmoothingProblem

_STANDSTILL_SQ = 1e-6  # Below this v² the vehicle stands and no limit applies [m²/s²]


def travel_time(station: Floats, speed_sq: Floats) -> float:
    """Time until the last movement ends [s]."""
    return float(core.motion(station, np.maximum(speed_sq, 0.0))[1][-1])


def excess(
    station: Floats, speed_sq: Floats, speed_sq_max: Floats, accel: Floats, decel: Floats
) -> float:
    """Largest violation of a bound, as a share of the largest speed or acceleration allowed."""
    gained = np.diff(speed_sq) / (2.0 * np.diff(station))
    moving = np.maximum(speed_sq[:-1], speed_sq[1:]) > _STANDSTILL_SQ
    violations = (
        (np.sqrt(np.maximum(speed_sq, 0.0)) - np.sqrt(np.maximum(speed_sq_max, 0.0))).max()
        / np.sqrt(speed_sq_max.max()),
        (gained - accel)[moving].max(initial=0.0) / accel.max(),
        (-gained - decel)[moving].max(initial=0.0) / decel.max(),
    )
    return float(max(0.0, *violations))


def stations_of(problem: SmoothingProblem) -> Floats:
    """Stations of a smoothing problem, from 0, shape (N,) [m]."""
    return np.concatenate(([0.0], np.cumsum(problem.ds)))


def smooth_excess(problem: SmoothingProblem, speed_sq: Floats) -> float:
    """Largest violation of a bound or of the jerk limit between moving segments, as a share."""
    limits = (problem.speed_sq_max, problem.accel_max, problem.decel_max)
    without_jerk = excess(stations_of(problem), speed_sq, *limits)
    speed = np.sqrt(np.maximum(speed_sq, 0.0))
    speeds = speed[1:] + speed[:-1]
    moving = np.maximum(problem.speed_sq_max[:-1], problem.speed_sq_max[1:]) > _STANDSTILL_SQ
    time = np.divide(2.0 * problem.ds, speeds, out=np.full_like(speeds, np.inf), where=speeds > 0.0)
    change = np.abs(np.diff(np.diff(speed_sq) / (2.0 * problem.ds)))
    jerk = change / (0.5 * (time[:-1] + time[1:]))
    driven = moving[:-1] & moving[1:]
    return max(without_jerk, float(jerk[driven].max(initial=0.0)) / problem.jerk - 1.0)
