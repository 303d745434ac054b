"""The ground as the guard knows it: whole maps and patches, heights and surfaces at points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.errors import InputError, ParameterError
from slopewise.services.io import npz_map
from slopewise.services.io.no_data import known_heights
from slopewise.services.wire.messages import MapUpdate

_OFF_GRID = 1e-3


@dataclass(frozen=True, slots=True)
class GuardGround:
    """A map.

    Attributes:
        elevation: (rows, columns) [m], row 0 at minimum y, NaN where unknown.
        resolution: [m]. origin: x, y of the centre of cell [0, 0] [m].
        classes: (rows, columns) into ``names``; None: all of them the first.
        names: of surfaces.
    """

    elevation: Floats
    resolution: float
    origin: tuple[float, float]
    classes: Ints | None = None
    names: tuple[str, ...] = ("",)

    def heights(self, x: Floats, y: Floats) -> Floats:
        """Bilinear between cell centres, any shape; NaN beside unknown cells and off the map."""
        z = self.elevation
        rows, columns = z.shape
        u, v = (x - self.origin[0]) / self.resolution, (y - self.origin[1]) / self.resolution
        inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
        u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
        i = np.minimum(v.astype(np.int64), rows - 2)
        j = np.minimum(u.astype(np.int64), columns - 2)
        p, q = u - j, v - i
        flat, first = z.ravel(), i * columns + j
        low = (1.0 - p) * flat[first] + p * flat[first + 1]
        high = (1.0 - p) * flat[first + columns] + p * flat[first + columns + 1]
        found: Floats = np.where(inside, (1.0 - q) * low + q * high, np.nan)
        return found

    def surfaces(self, x: Floats, y: Floats) -> Ints:
        """Numbers of the surfaces at points, any shape; off the map the first."""
        if self.classes is None:
            return np.zeros(np.shape(x), np.int64)
        rows, columns = self.elevation.shape
        j = np.clip(np.rint((x - self.origin[0]) / self.resolution), 0, columns - 1)
        i = np.clip(np.rint((y - self.origin[1]) / self.resolution), 0, rows - 1)
        found: Ints = self.classes[i.astype(np.int64), j.astype(np.int64)]
        return found


def read_ground(path: Path) -> GuardGround:
    """The ground in an .npz file, read as plans read it.

    Raises:
        InputError: names the file and the array.
    """
    info = npz_map.read_info(path)
    heights, classes, names, _ = npz_map.read_layers(path)
    update = MapUpdate(
        source=str(path),
        sequence=1,
        elevation=heights,
        resolution=info.resolution,
        origin=info.origin,
        terrain_class=classes,
        class_names=list(names),
    )
    try:
        return ground_of(update, None)
    except ParameterError as error:
        raise InputError(str(path), error.field, f"expected {error.expected}") from None


def ground_of(update: MapUpdate, known: GuardGround | None) -> GuardGround:
    """The ground after an update.

    Raises:
        ParameterError: it is no ground, or does not fit what is known.
    """
    heights = update.elevation
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ParameterError("elevation", f"at least 2 x 2 cells, got shape {heights.shape}")
    around = [known.elevation] if update.patch and known is not None else []
    heights, _ = known_heights(heights, None, around)
    classes = None if update.terrain_class is None else _classes_of(update)
    if not update.patch:
        names = tuple(update.class_names or ("",))
        return GuardGround(heights, update.resolution, update.origin, classes, names)
    if known is None:
        raise ParameterError("patch", "a whole map first, there is none yet")
    if abs(update.resolution - known.resolution) > 1e-6 * known.resolution:
        raise ParameterError("resolution", f"{known.resolution:g} m, got {update.resolution:g}")
    offset = (np.array(update.origin) - known.origin) / known.resolution
    if not np.all(np.abs(offset - np.round(offset)) <= _OFF_GRID):
        raise ParameterError("origin", f"a cell of the whole map, got {update.origin}")
    column, row = (int(n) for n in np.round(offset))
    ends = row + heights.shape[0], column + heights.shape[1]
    rows, columns = known.elevation.shape
    if min(row, column) < 0 or ends[0] > rows or ends[1] > columns:
        raise ParameterError("patch", "cells within the whole map")
    cells = slice(row, ends[0]), slice(column, ends[1])
    elevation = known.elevation.copy()
    elevation[cells] = heights
    if classes is not None:
        if update.class_names is not None and tuple(update.class_names) != known.names:
            raise ParameterError("class_names", "those of the whole map")
        whole = np.zeros(elevation.shape, np.int64) if known.classes is None else known.classes
        patched = whole.copy()
        patched[cells] = classes
        return replace(known, elevation=elevation, classes=patched)
    return replace(known, elevation=elevation)


def _classes_of(update: MapUpdate) -> Ints:
    classes, names = update.terrain_class, update.class_names or [""]
    assert classes is not None
    whole = classes.shape == update.elevation.shape and np.isfinite(classes).all()
    if not whole or np.any(classes != np.round(classes)) or not _within(classes, len(names)):
        raise ParameterError("terrain_class", f"a number below {len(names)} for each cell")
    found: Ints = classes.astype(np.int64)
    return found


def _within(classes: Floats, count: int) -> bool:
    inside: Bools = (classes >= 0) & (classes < count)
    return bool(inside.all())
