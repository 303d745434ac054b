"""Five points of the ground that a vehicle stands on, in cells of a map."""

from __future__ import annotations

from models.arrays import Floats
from planner.kernels.compiled import inlined, row_pass

POINTS = 5
"""Front left, front right, rear left, rear right, and the middle of the wheelbase."""


@inlined
def offset(point: int, half_length: float, half_width: float) -> tuple[float, float]:
    """How far a point lies ahead of the middle of the wheelbase, and how far to its left [m]."""
    ahead = 0.0 if point == 4 else (half_length if point < 2 else -half_length)
    aside = 0.0 if point == 4 else (half_width if point % 2 == 0 else -half_width)
    return ahead, aside


@row_pass
def on_grid(
    origin_x: float, origin_y: float, per_metre: float,
    x: Floats, y: Floats, heading_x: Floats, heading_y: Floats,
    u: Floats, v: Floats, ahead_u: Floats, ahead_v: Floats,
) -> None:  # fmt: skip
    """Position in cells, and cells gained by a metre ahead."""
    for j in range(x.shape[0]):
        u[j] = (x[j] - origin_x) * per_metre
        v[j] = (y[j] - origin_y) * per_metre
        ahead_u[j] = heading_x[j] * per_metre
        ahead_v[j] = heading_y[j] * per_metre
