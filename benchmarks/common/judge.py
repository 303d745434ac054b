"""One measure for the answers of all solvers: how long the drive takes, and what it breaks."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.plan import motion_of
from slopewise.planner.profile.smoothing_problem import SmoothingProblem

_INTERCEPT = 1e-6
"""Below this v² nothing is asked any more [m²/s²]."""


def travel_time(station: Floats, speed_sq: Floats) -> float:
    """Until the last movement ends [s]."""
    return float(motion_of(station, np.maximum(speed_sq, 0.0))[1][-1])


def excess(
    station: Floats, speed_sq: Floats, speed_sq_max: Floats, accel: Floats, decel: Floats
) -> float:
    """Largest breach of a bound, as a share of the largest speed or acceleration allowed.

    Args:
        station, speed_sq, speed_sq_max: (N,).
        accel, decel: (N − 1,) limits on each segment [m/s²].
    """
    gained = np.diff(speed_sq) / (2.0 * np.diff(station))
    moving = np.maximum(speed_sq[:-1], speed_sq[1:]) > _INTERCEPT
    breaches = (
        (np.sqrt(np.maximum(speed_sq, 0.0)) - np.sqrt(np.maximum(speed_sq_max, 0.0))).max()
        / np.sqrt(speed_sq_max.max()),
        (gained - accel)[moving].max(initial=0.0) / accel.max(),
        (-gained - decel)[moving].max(initial=0.0) / decel.max(),
    )
    return float(max(0.0, *breaches))


def smooth_excess(problem: SmoothingProblem, speed_sq: Floats) -> float:
    """As :func:`excess`, with the jerk between segments that move as a share of its limit."""
    station = np.concatenate(([0.0], np.cumsum(problem.ds)))
    plain = excess(station, speed_sq, problem.speed_sq_max, problem.accel_max, problem.decel_max)
    speed = np.sqrt(np.maximum(speed_sq, 0.0))
    both = speed[1:] + speed[:-1]
    moving = np.maximum(problem.speed_sq_max[:-1], problem.speed_sq_max[1:]) > _INTERCEPT
    time = np.divide(2.0 * problem.ds, both, out=np.full_like(both, np.inf), where=both > 0.0)
    change = np.abs(np.diff(np.diff(speed_sq) / (2.0 * problem.ds)))
    jerk = change / (0.5 * (time[:-1] + time[1:]))
    driven = moving[:-1] & moving[1:]
    return max(plain, float(jerk[driven].max(initial=0.0)) / problem.jerk - 1.0)
