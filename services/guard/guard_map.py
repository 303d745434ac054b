"""Ground as the guard sees it: the first map, heights and surfaces at points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.io import npz_map
from slopewise.services.io.files import faults_of


def read_guard_map(path: Path) -> ElevationMap:
    """Map in an .npz file."""
    info, cells = npz_map.read_info(path), slice(None)
    heights, std, assumed, classes, names = npz_map.read_layers(path, cells, cells, None, None)
    with faults_of(path):
        return ElevationMap(
            elevation=heights,
            resolution=info.resolution,
            origin=info.origin,
            terrain_class=classes,
            class_names=names,
            height_std=std,
            assumed=assumed,
        )


def heights_at(ground: ElevationMap, x: Floats, y: Floats) -> Floats:
    """Bilinear heights at points of any shape [m]; NaN at unknown cells and off the map."""
    rows, columns = ground.elevation.shape
    u, v = (x - ground.origin[0]) / ground.resolution, (y - ground.origin[1]) / ground.resolution
    inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    i = np.minimum(v.astype(np.int64), rows - 2)
    j = np.minimum(u.astype(np.int64), columns - 2)
    p, q = u - j, v - i
    flat, first = ground.elevation.ravel(), i * columns + j
    low = (1.0 - p) * flat[first] + p * flat[first + 1]
    high = (1.0 - p) * flat[first + columns] + p * flat[first + columns + 1]
    return np.where(inside, (1.0 - q) * low + q * high, np.nan)


def classes_at(ground: ElevationMap, x: Floats, y: Floats) -> Ints:
    """Indices into ``class_names`` at points; off the map those of the nearest cell."""
    if ground.terrain_class is None:
        return np.zeros(np.shape(x), np.int64)
    rows, columns = ground.elevation.shape
    j = np.clip(np.rint((x - ground.origin[0]) / ground.resolution), 0, columns - 1)
    i = np.clip(np.rint((y - ground.origin[1]) / ground.resolution), 0, rows - 1)
    indices: Ints = ground.terrain_class[i.astype(np.int64), j.astype(np.int64)]
    return indices
