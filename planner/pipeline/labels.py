"""What a plan may gain and lose on each segment, and what holds it at each station."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.compiled_core import core
from slopewise.planner.limiting import Limiting
from slopewise.planner.planning_limits import PlanningLimits
from slopewise.planner.verify.track import Track

_CODES = (Limiting.TRACTION, Limiting.ACCEL, Limiting.DECEL, Limiting.JERK)


def segment_limits(
    track: Track,
    speed_sq: Floats,
    accel_max: Floats,
    demand: Floats,
    braking_intercept: Floats,
    n: PlanningLimits,
) -> tuple[Floats, Floats]:
    """Accelerations allowed on each segment at any speed up to a profile.

    Args:
        track: the candidate.
        speed_sq: (N,) the profile [m²/s²].
        accel_max, demand, braking_intercept: (N,) as of bounds and ground.
        n: the model.

    Returns:
        Acceleration and deceleration, (N − 1,) each, both >= 0 [m/s²].
    """
    accel, decel = np.empty((2, len(speed_sq) - 1))
    core.segment_limits(track, speed_sq, accel_max, demand, braking_intercept, n, accel, decel)
    return accel, decel


def labels(
    speed_sq: Floats,
    accel: Floats,
    bound: Floats,
    bound_label: Ints,
    accel_max: Floats,
    decel_max: Floats,
    most_accel: float,
    smoothed: bool,
) -> Ints:
    """What holds at each station: its bound, or how fast the speed may change around it.

    Args:
        speed_sq, accel: (N,) the plan [m²/s²], [m/s²].
        bound, bound_label: (N,) highest v² and what says so.
        accel_max, decel_max: (N − 1,) of :func:`segment_limits`.
        most_accel: by comfort; less than that is for want of traction [m/s²].
        smoothed: what holds neither bound nor acceleration back is jerk.

    Returns:
        (N,) codes of :class:`slopewise.planner.limiting.Limiting`.
    """
    result = np.empty(len(speed_sq), np.int64)
    core.labels(
        speed_sq,
        accel,
        bound,
        bound_label,
        accel_max,
        decel_max,
        most_accel,
        smoothed,
        _CODES,
        result,
    )
    return result
