"""How much faster than planned the vehicle may be when its brakes take hold.

The speed controller misses its speed by some error; and while the dead time runs, the drive may be
cut, so that a slope steeper than the motion resistance speeds the vehicle up. A stop is bounded for
the speed that the vehicle may really have, as if it had it from the command on, which is longer
still.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.kernels.rows import copy_row
from slopewise.planner.kernels.workspace import empty


def speed_excess(
    profile: TerrainProfile, ground: BrakingGround, limits: PlanningLimits
) -> Floats | None:
    """Speed beyond the planned one that a stop may begin with, (N, M) [m/s]; None where none.

    Args:
        profile: terrain under the wheels.
        ground: braking along the candidates, with its errors.
        limits: of the model.
    """
    errors = ground.errors
    steepest = float(profile.sin_grade.min())
    runs_off = errors.drive_cut and -steepest > limits.resistance
    if not runs_off:
        return np.full_like(profile.grade, errors.speed) if errors.speed > 0.0 else None
    excess = empty(*profile.grade.shape)
    longest = float(ground.dead_time.max())
    gained = GRAVITY * (-steepest - limits.resistance) * longest
    step = float(profile.station[1, 0] - profile.station[0, 0])
    reach = (float(ground.fastest.max()) + errors.speed + gained) * longest
    rows = int(np.ceil(reach / max(step, 1e-3))) + 1
    _excess(profile.sin_grade, ground.dead_time, rows, limits.resistance, errors.speed, excess)
    return excess


@kernel
def _excess(
    sin_grade: Floats, dead_time: Floats, rows: int, resistance: float, error: float, out: Floats
) -> None:
    """Gain on the steepest ground that the dead time may lead over."""
    last = sin_grade.shape[0] - 1
    lowest = np.empty(sin_grade.shape[1])
    for k in range(last + 1):
        copy_row(sin_grade[k], lowest)
        for i in range(k + 1, min(k + rows, last) + 1):
            _lower(sin_grade[i], lowest)
        _gain(lowest, dead_time[k], resistance, error, out[k])


@row_pass
def _lower(sin_grade: Floats, lowest: Floats) -> None:
    for j in range(lowest.shape[0]):
        lowest[j] = min(lowest[j], sin_grade[j])


@row_pass
def _gain(lowest: Floats, dead_time: Floats, resistance: float, error: float, out: Floats) -> None:
    for j in range(lowest.shape[0]):
        out[j] = error + GRAVITY * max(-lowest[j] - resistance, 0.0) * dead_time[j]


@kernel
def add_speed(speed_sq: Floats, excess: Floats, sign: float) -> None:
    """Add (+1) or take away (−1) an excess of speed from bounds on v² (N, M); those <= 0 stay."""
    for k in range(speed_sq.shape[0]):
        _add_row(speed_sq[k], excess[k], sign)


@row_pass
def _add_row(speed_sq: Floats, excess: Floats, sign: float) -> None:
    for j in range(speed_sq.shape[0]):
        there = speed_sq[j]
        speed = max(np.sqrt(max(there, 0.0)) + sign * excess[j], 0.0)
        speed_sq[j] = speed * speed if there > 0.0 else there
