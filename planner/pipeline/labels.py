"""What a plan may gain and lose on each segment, and what holds it at each station."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.limiting import Limiting
from slopewise.planner.verify.track import Track

_HARDLY = 0.01
"""Accelerations closer than this are one to a reader [m/s²]."""

_TRACTION = int(Limiting.TRACTION)
_ACCEL = int(Limiting.ACCEL)
_DECEL = int(Limiting.DECEL)
_JERK = int(Limiting.JERK)


@inlined
def _least_force(track: Track, k: int, fast: float) -> float:
    """The part of the lower bound of the force that depends on speed, up to this one."""
    slow, part = track.slowest[k], track.lower_slope[k]
    return float(min(slow * part, max(fast, slow) * part))


@kernel
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
    accel, decel = np.empty(speed_sq.shape[0] - 1), np.empty(speed_sq.shape[0] - 1)
    sine_before = np.sin(track.grade[0])
    for k in range(speed_sq.shape[0] - 1):
        sine = np.sin(track.grade[k + 1])
        fast = np.sqrt(max(speed_sq[k], speed_sq[k + 1], 1e-6))
        # Brakes that grow weaker with speed do so at either end from the segment's fastest.
        braking = min(
            _least_force(track, k, fast) + braking_intercept[k] + sine_before,
            _least_force(track, k + 1, fast) + braking_intercept[k + 1] + sine,
        )
        powered = GRAVITY * (n.specific_power / fast - max(demand[k], demand[k + 1]))
        accel[k] = max(min(accel_max[k], accel_max[k + 1], powered), 0.0)
        decel[k] = max(min(GRAVITY * braking, n.decel), 0.0)
        sine_before = sine
    return accel, decel


@kernel
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
    result = np.empty(speed_sq.shape[0], np.int64)
    for k in range(speed_sq.shape[0]):
        if speed_sq[k] >= bound[k] - 1e-3 * max(bound[k], 0.05):
            result[k] = bound_label[k]
            continue
        segment = min(k, accel_max.shape[0] - 1)
        before = accel[max(k - 1, 0)]
        lowest, highest = min(accel[k], before), max(accel[k], before)
        if lowest < -_HARDLY:
            label, full = _DECEL, lowest <= -decel_max[segment] * 0.99
        else:
            label = _TRACTION if accel_max[segment] < 0.99 * most_accel else _ACCEL
            full = highest >= accel_max[segment] * 0.99 - _HARDLY
        result[k] = label if full or not smoothed else _JERK
    return result
