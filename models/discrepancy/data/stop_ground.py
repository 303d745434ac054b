"""What vehicles met along their stops."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.thresholds import LATEST_SESSION_CLOCK


class StopGround(NamedTuple):
    """What the vehicle meets along its stop, (S, M) each; zero where the log does not tell."""

    grade: Floats
    roll: Floats
    yaw: Floats
    turning: Floats
    x: Floats
    y: Floats
    vertical_curvature: Floats


def ground_of(table: StopTable) -> StopGround:
    """As it was met by the measured vehicle."""
    return StopGround(
        table.grade,
        table.roll,
        table.yaw,
        table.yaw_rate,
        table.x,
        table.y,
        table.vertical_curvature,
    )


def session_time(table: StopTable) -> Floats:
    """(S,) since the session began [s]: the log's clock, or since its first stop."""
    late = float(table.clock[0]) > LATEST_SESSION_CLOCK
    return table.clock - table.clock[0] if late else table.clock
