"""Elevation maps from map messages: a whole map, or the known one with a patch."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io import height_error, no_data
from slopewise.services.io.map_grid import check_physical
from slopewise.services.wire.plan_messages import MapUpdate

_MAX_HEIGHT_STD = 10.0
"""Largest height error of a measured map [m]: coarse satellite elevation is within it."""

_MAX_GRID_ERROR = 1e-3
"""Distance of a patch's cells from those of the map, as a share of a cell [1]: rounding."""

_MAX_CLASS = 2**20  # exclusive limit of class numbers in a patch, which may name no classes [1]


def update_of(ground: ElevationMap, source: str, sequence: int) -> MapUpdate:
    """The message that sends a whole map."""
    return MapUpdate(
        source=source,
        sequence=sequence,
        elevation=ground.elevation,
        resolution=ground.resolution,
        origin=ground.origin,
        terrain_class=ground.terrain_class,
        class_names=list(ground.class_names),
        height_std=None if ground.height_std_is_assumed else ground.height_std,
        correlation_length=ground.correlation_length or None,
    )


def apply_update(update: MapUpdate, known: ElevationMap | None) -> ElevationMap:
    """The map after an update; ``known``: before it, None before the first one."""
    if not update.patch:
        return _whole_map(update)
    if known is None:
        raise ParameterError("patch", "a whole map first, there is none yet")  # words: ok
    return _patched_map(update, known)


def _whole_map(update: MapUpdate) -> ElevationMap:
    classes = None if update.terrain_class is None else _classes(update)
    std = update.height_std
    heights, assumed = _heights(update)
    return ElevationMap(
        elevation=heights,
        resolution=update.resolution,
        origin=update.origin,
        terrain_class=classes,
        class_names=tuple(update.class_names or ("",)),
        height_std=height_error.assumed(update.resolution) if std is None else std,
        height_std_is_assumed=std is None,
        correlation_length=update.correlation_length or 0.0,
        assumed=assumed,
    )


def _patched_map(update: MapUpdate, known: ElevationMap) -> ElevationMap:
    if abs(update.resolution - known.resolution) > 1e-6 * known.resolution:
        expected = f"{known.resolution:g} m as the whole map, got {update.resolution:g}"
        raise ParameterError("resolution", expected)
    heights, assumed = _heights(update, known.elevation)
    cells = _cells_of(update, known)
    elevation = known.elevation.copy()
    elevation[cells] = heights
    classes = known.terrain_class
    if update.terrain_class is not None:
        if update.class_names is not None and tuple(update.class_names) != known.class_names:
            raise ParameterError("class_names", "those of the whole map")
        classes = np.zeros(elevation.shape, np.int64) if classes is None else classes.copy()
        classes[cells] = _classes(update)
    std = max(known.height_std, update.height_std or 0.0)
    return replace(
        known,
        elevation=elevation,
        terrain_class=classes,
        height_std=std,
        # An assumed error stays one: the patch states that of its cells, not that of the others.
        height_std_is_assumed=known.height_std_is_assumed,
        correlation_length=max(known.correlation_length, update.correlation_length or 0.0),
        assumed=assumed,
    )


def _cells_of(update: MapUpdate, known: ElevationMap) -> tuple[slice, slice]:
    """Rows and columns of a known map that a patch replaces."""
    offset = (np.array(update.origin) - known.origin) / known.resolution
    if not np.all(np.abs(offset - np.round(offset)) <= _MAX_GRID_ERROR):
        raise ParameterError("origin", f"a cell of the whole map, got {update.origin}")
    column, row = (int(n) for n in np.round(offset))
    patch_rows, patch_columns = update.elevation.shape
    rows, columns = known.elevation.shape
    if min(row, column) < 0 or row + patch_rows > rows or column + patch_columns > columns:
        expected = f"cells within the {rows} x {columns} of the whole map"
        raise ParameterError("patch", f"{expected}, got row {row}, column {column} on")
    return slice(row, row + patch_rows), slice(column, column + patch_columns)


def update_id(update: MapUpdate) -> str:
    """Source, instance and number of an update, as one word."""
    start = f"/{update.instance}" if update.instance else ""
    return f"{update.source}{start}#{update.sequence}"


def digest(cells: ElevationMap | MapUpdate, before: str = "") -> str:
    """SHA-256 of a whole map's cells; of a patch's cells and the digest ``before`` it."""
    head = (
        before,
        cells.elevation.shape,
        cells.resolution,
        list(cells.origin),
        list(cells.class_names or ()),
        cells.height_std,
        *([cells.correlation_length] if cells.correlation_length else []),
    )
    sha256 = hashlib.sha256(json.dumps(head).encode())
    sha256.update(np.ascontiguousarray(cells.elevation, np.float64).data)
    if cells.terrain_class is not None:
        sha256.update(np.ascontiguousarray(cells.terrain_class, np.int64).data)
    return sha256.hexdigest()


def _heights(update: MapUpdate, *around: Floats) -> tuple[Floats, tuple[str, ...]]:
    """Heights, NaN where unknown, and assumptions about them; ``around``: the map they change."""
    heights = update.elevation
    if not (update.height_std or 0.0) <= _MAX_HEIGHT_STD:
        expected = f"a number of 0 … {_MAX_HEIGHT_STD:g} m, got {update.height_std:g}"
        raise ParameterError("height_std", expected)
    if heights.ndim != 2 or heights.size == 0:
        raise ParameterError("elevation", f"cells (rows, columns), got shape {heights.shape}")
    check_physical(update.resolution, update.origin, heights.shape)
    known, markers = no_data.known_heights(heights, None, around)
    return known, no_data.describe(markers, remedy="")


def _classes(update: MapUpdate) -> np.ndarray:
    classes = update.terrain_class
    assert classes is not None
    if classes.shape != update.elevation.shape:
        expected = f"the shape of elevation {update.elevation.shape}, got {classes.shape}"
        raise ParameterError("terrain_class", expected)
    limit = _MAX_CLASS if update.patch else len(update.class_names or ("",))
    if not np.all((classes >= 0) & (classes < limit) & (classes == np.round(classes))):
        raise ParameterError("terrain_class", f"whole numbers 0 … {limit - 1}")
    return classes.astype(np.int64)
