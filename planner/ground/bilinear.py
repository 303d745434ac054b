"""Bilinear height between the centres of four cells."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import inlined


@inlined
def height_at(elevation: Floats, column: float, row: float) -> float:
    """Bilinear height [m] at fractional grid coordinates; NaN off the map or beside unknown cells.

    Args:
        elevation: (rows, cols) [m].
        column, row: in cells, from the centre of cell [0, 0].
    """
    rows, columns = elevation.shape
    if not (column >= 0.0 and row >= 0.0 and column <= columns - 1 and row <= rows - 1):
        return np.nan
    j = min(int(column), columns - 2)
    i = min(int(row), rows - 2)
    u = column - j
    v = row - i
    lower = elevation[i, j] + u * (elevation[i, j + 1] - elevation[i, j])
    upper = elevation[i + 1, j] + u * (elevation[i + 1, j + 1] - elevation[i + 1, j])
    return float(lower + v * (upper - lower))
