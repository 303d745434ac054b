"""Heights of a map at any point: bilinear between cell centres, unknown next to unknown cells."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints


class Heights(Protocol):
    """A map as the checker needs it; :class:`slopewise.ElevationMap` is one.

    Attributes:
        elevation: (rows, cols) heights, row 0 at minimum y, NaN where unknown [m].
        resolution: edge of a cell [m]. origin: (x, y) of the centre of cell [0, 0] [m].
        terrain_class: (rows, cols) index into ``class_names``, None for the base everywhere.
    """

    @property
    def elevation(self) -> Floats: ...
    @property
    def resolution(self) -> float: ...
    @property
    def origin(self) -> tuple[float, float]: ...
    @property
    def terrain_class(self) -> Ints | None: ...
    @property
    def class_names(self) -> tuple[str, ...]: ...


def in_cells(heights: Heights, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """(column, row) of points in cells, from the centre of cell [0, 0]; any shape."""
    x0, y0 = heights.origin
    return (x - x0) / heights.resolution, (y - y0) / heights.resolution


def height_of(heights: Heights, x: Floats, y: Floats) -> Floats:
    """Heights of points of any shape [m]; NaN off the map, and where a cell around is unknown."""
    z = heights.elevation
    rows, columns = z.shape
    u, v = in_cells(heights, x, y)
    inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    i = np.minimum(v.astype(np.int64), rows - 2)
    j = np.minimum(u.astype(np.int64), columns - 2)
    p, q = u - j, v - i
    height = (1.0 - q) * ((1.0 - p) * z[i, j] + p * z[i, j + 1]) + q * (
        (1.0 - p) * z[i + 1, j] + p * z[i + 1, j + 1]
    )
    return np.where(inside, height, np.nan)


def cell_is_known(heights: Heights, x: Floats, y: Floats) -> Bools:
    """Whether the one cell that holds each point is known; any shape.

    Less than a cell beyond its outermost centres the cell at its rim is used.
    """
    z = heights.elevation
    rows, columns = z.shape
    u, v = in_cells(heights, x, y)
    inside = (u > -1.0) & (v > -1.0) & (u < columns) & (v < rows)
    i = np.clip(np.floor(np.where(inside, v, 0.0) + 0.5).astype(np.int64), 0, rows - 1)
    j = np.clip(np.floor(np.where(inside, u, 0.0) + 0.5).astype(np.int64), 0, columns - 1)
    known: Bools = inside & np.isfinite(z[i, j])
    return known


def classes_around(heights: Heights, x: Floats, y: Floats) -> Bools:
    """Which terrain classes the four cells around points have, (classes, …).

    Without classes all ground is class 0; so is ground off the map.
    """
    x, y = np.asarray(x), np.asarray(y)
    touched = np.zeros((len(heights.class_names), *x.shape), np.bool_)
    classes = heights.terrain_class
    if classes is None:
        touched[0] = True
        return touched
    rows, columns = classes.shape
    u, v = in_cells(heights, x, y)
    for right in (0, 1):
        for up in (0, 1):
            i = np.clip(np.floor(v).astype(np.int64) + up, 0, rows - 1)
            j = np.clip(np.floor(u).astype(np.int64) + right, 0, columns - 1)
            np.put_along_axis(touched, classes[i, j][None], True, axis=0)
    return touched
