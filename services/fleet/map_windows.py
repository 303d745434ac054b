"""Windows of a large map: paths that share one, and the ground in it.

Memory is bounded by the window, for a map of any size. Paths that lie close together share a
window, so that tiles are not decoded again for every path.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.io import geotiff
from slopewise.services.io.geotiff import GeotiffWindows
from slopewise.services.io.map_grid import Extent, MapInfo
from slopewise.services.io.no_data import NoData

SHARED_CELLS = 1_000_000  # Cells up to which paths share a window: 8 MB of heights
MAX_CELLS = 8_000_000  # Cells that a single path may need: 64 MB of heights, 2.8 km x 2.8 km at 1 m
_BLOCK_CACHE = 64  # Decoded tiles [MB]; GDAL's default is a share of the machine's memory
_SORTING_SQUARE = 256  # Edge of the squares by which paths are sorted, in cells
_NOWHERE = (math.inf, -math.inf, math.inf, -math.inf)  # Extent of no path [m]

Cells = tuple[slice, slice]
"""Rows and columns of a window."""


@contextmanager
def opened(path: Path, nodata: NoData = None) -> Iterator[GeotiffWindows]:
    """A map to read windows of, with a small cache of tiles."""
    import rasterio

    with rasterio.Env(GDAL_CACHEMAX=_BLOCK_CACHE), geotiff.opened(path, nodata) as ground:
        yield ground


def map_windows(
    paths: Sequence[CandidatePath], info: MapInfo, margin: float
) -> Iterator[tuple[list[int], Cells | None]]:
    """Indices of paths that share a window, and the cells that hold their ground.

    All paths begin on the map and need ``margin`` metres around them. Without cells are those that
    would need too many.
    """
    around = [_around(path, margin) for path in paths]
    edge = _SORTING_SQUARE * info.resolution
    order = sorted(range(len(paths)), key=lambda i: (around[i][2] // edge, around[i][0] // edge, i))
    members: list[int] = []
    union = _NOWHERE
    for i in order:
        wider = _union(union, around[i])
        if members and _size(info, wider) > SHARED_CELLS:
            yield members, _cells(union, info)
            members, wider = [], around[i]
        members.append(i)
        union = wider
    if members:
        yield members, _cells(union, info)


def ground_in(ground: GeotiffWindows, cells: Cells) -> ElevationMap:
    """Ground of a window, unknown cells included."""
    part = ground.info.part(*cells)
    heights = ground.read(*cells)
    if not np.isfinite(heights).any():
        heights = _with_a_known_cell(heights)
    return ElevationMap(
        elevation=heights,
        resolution=part.resolution,
        origin=part.origin,
        height_std=ground.height_std,
        height_std_is_assumed=ground.stated_std is None,
    )


def _with_a_known_cell(heights: Floats) -> Floats:
    """Add a known cell, which a map requires, behind the window, where no wheel reaches."""
    beyond = np.full((2, heights.shape[1]), np.nan)
    beyond[-1, -1] = 0.0
    return np.concatenate((heights, beyond))


def _around(path: CandidatePath, margin: float) -> Extent:
    (x_min, y_min), (x_max, y_max) = path.points.min(axis=0), path.points.max(axis=0)
    return x_min - margin, x_max + margin, y_min - margin, y_max + margin


def _union(a: Extent, b: Extent) -> Extent:
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])


def _size(info: MapInfo, around: Extent) -> int:
    cells = info.cells_around(around)
    if cells is None:
        return 0
    rows, columns = cells
    return int((rows.stop - rows.start) * (columns.stop - columns.start))


def _cells(around: Extent, info: MapInfo) -> Cells | None:
    return info.cells_around(around) if 0 < _size(info, around) <= MAX_CELLS else None
