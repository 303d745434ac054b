"""Ground that the guard knows: whole maps and patches, heights and surfaces at points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.errors import InputError, ParameterError
from slopewise.services.io import npz_map
from slopewise.services.io.no_data import known_heights
from slopewise.services.wire.plan_messages import MapUpdate

_GRID_TOLERANCE = 1e-3
"""Part of a cell by which a patch may lie off the grid: rounding of map coordinates [1]."""

_SAME_RESOLUTION = 1e-6  # relative difference of cell sizes that rounding makes [1]


@dataclass(frozen=True, slots=True)
class GuardMap:
    """Elevation map with surfaces.

    Attributes:
        elevation: (rows, columns) heights [m], row 0 at minimum y, NaN where unknown.
        resolution: edge of a cell [m].
        origin: x, y of the centre of cell [0, 0] [m].
        classes: (rows, columns) indices into ``names``; None: every cell has index 0.
        names: names of surfaces.
    """

    elevation: Floats
    resolution: float
    origin: tuple[float, float]
    classes: Ints | None = None
    names: tuple[str, ...] = ("",)

    def heights(self, x: Floats, y: Floats) -> Floats:
        """Bilinear heights at points of any shape [m]; NaN at unknown cells and off the map."""
        rows, columns = self.elevation.shape
        u, v = (x - self.origin[0]) / self.resolution, (y - self.origin[1]) / self.resolution
        inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
        u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
        i = np.minimum(v.astype(np.int64), rows - 2)
        j = np.minimum(u.astype(np.int64), columns - 2)
        p, q = u - j, v - i
        flat, first = self.elevation.ravel(), i * columns + j
        low = (1.0 - p) * flat[first] + p * flat[first + 1]
        high = (1.0 - p) * flat[first + columns] + p * flat[first + columns + 1]
        return np.where(inside, (1.0 - q) * low + q * high, np.nan)

    def surfaces(self, x: Floats, y: Floats) -> Ints:
        """Indices into ``names`` at points of any shape; off the map those of the nearest cell."""
        if self.classes is None:
            return np.zeros(np.shape(x), np.int64)
        rows, columns = self.elevation.shape
        j = np.clip(np.rint((x - self.origin[0]) / self.resolution), 0, columns - 1)
        i = np.clip(np.rint((y - self.origin[1]) / self.resolution), 0, rows - 1)
        indices: Ints = self.classes[i.astype(np.int64), j.astype(np.int64)]
        return indices


def read_guard_map(path: Path) -> GuardMap:
    """Map in an .npz file."""
    info = npz_map.read_info(path)
    heights, classes, names, _ = npz_map.read_raw(path)
    try:
        return GuardMap(_known(heights), info.resolution, info.origin, classes, names)
    except ParameterError as error:
        raise InputError(str(path), error.field, f"expected {error.expected}") from None


def apply_update(update: MapUpdate, known: GuardMap | None) -> GuardMap:
    """Map after an update."""
    heights = _known(update.elevation, known if update.patch else None)
    classes = None if update.terrain_class is None else _classes_of(update)
    if not update.patch:
        names = tuple(update.class_names or ("",))
        return GuardMap(heights, update.resolution, update.origin, classes, names)
    if known is None:
        raise ParameterError("patch", "a whole map first, no map came yet")
    cells = _cells_of(update, known)
    elevation = known.elevation.copy()
    elevation[cells] = heights
    if classes is None:
        return replace(known, elevation=elevation)
    if update.class_names is not None and tuple(update.class_names) != known.names:
        raise ParameterError("class_names", "those of the whole map")
    before = np.zeros(elevation.shape, np.int64) if known.classes is None else known.classes
    patched = before.copy()
    patched[cells] = classes
    return replace(known, elevation=elevation, classes=patched)


def _known(heights: Floats, around: GuardMap | None = None) -> Floats:
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ParameterError("elevation", f"at least 2 x 2 cells, got shape {heights.shape}")
    known, _ = known_heights(heights, None, [] if around is None else [around.elevation])
    return known


def _cells_of(update: MapUpdate, known: GuardMap) -> tuple[slice, slice]:
    """Rows and columns of a patch."""
    if abs(update.resolution - known.resolution) > _SAME_RESOLUTION * known.resolution:
        raise ParameterError("resolution", f"{known.resolution:g} m, got {update.resolution:g}")
    offset = (np.array(update.origin) - known.origin) / known.resolution
    if not np.all(np.abs(offset - np.round(offset)) <= _GRID_TOLERANCE):
        raise ParameterError("origin", f"a cell of the whole map, got {update.origin}")
    column, row = (int(n) for n in np.round(offset))
    last_row, last_column = row + update.elevation.shape[0], column + update.elevation.shape[1]
    rows, columns = known.elevation.shape
    if min(row, column) < 0 or last_row > rows or last_column > columns:
        raise ParameterError("patch", "cells within the whole map")
    return slice(row, last_row), slice(column, last_column)


def _classes_of(update: MapUpdate) -> Ints:
    classes, count = update.terrain_class, len(update.class_names or [""])
    assert classes is not None
    # Comparisons with NaN are false.
    fits = (classes >= 0) & (classes < count) & (classes == np.round(classes))
    if classes.shape != update.elevation.shape or not fits.all():
        raise ParameterError("terrain_class", f"a number below {count} for each cell")
    return classes.astype(np.int64)
