"""Five points of the ground that a vehicle stands on, in cells of a map."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import inlined, row_pass

POINTS = 5
"""Front left, front right, rear left, rear right, and the reference point on the path."""


class CellFrame(NamedTuple):
    """Where the cells of a map lie.

    Attributes:
        origin_x, origin_y: centre of cell [0, 0] [m]. per_metre: cells in a metre.
    """

    origin_x: float
    origin_y: float
    per_metre: float


class CellPoses(NamedTuple):
    """Poses of M candidates in cells of a map, (M,) each.

    Attributes:
        u, v: column and row. ahead_u, ahead_v: cells gained by a metre ahead.
    """

    u: Floats
    v: Floats
    ahead_u: Floats
    ahead_v: Floats


@inlined
def offset(point: int, half_length: float, half_width: float) -> tuple[float, float]:
    """How far a point lies ahead of the middle of the wheelbase, and how far to its left [m]."""
    ahead = 0.0 if point == 4 else (half_length if point < 2 else -half_length)
    aside = 0.0 if point == 4 else (half_width if point % 2 == 0 else -half_width)
    return ahead, aside


@row_pass
def on_grid(
    frame: CellFrame, x: Floats, y: Floats, heading_x: Floats, heading_y: Floats, poses: CellPoses
) -> None:
    """Positions and headings (M,) in cells of a map, into ``poses``."""
    u, v, ahead_u, ahead_v = poses
    for j in range(x.shape[0]):
        u[j] = (x[j] - frame.origin_x) * frame.per_metre
        v[j] = (y[j] - frame.origin_y) * frame.per_metre
        ahead_u[j] = heading_x[j] * frame.per_metre
        ahead_v[j] = heading_y[j] * frame.per_metre
