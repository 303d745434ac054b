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
from slopewise.services.io.map_grid import MapInfo
from slopewise.services.io.no_data import NoData

SHARED_CELLS = 1_000_000  # Cells up to which paths share a window: 8 MB of heights
MAX_CELLS = 8_000_000  # Cells that a single path may need: 64 MB of heights, 2.8 km x 2.8 km at 1 m
_BLOCK_CACHE = 64  # Decoded tiles [MB]; GDAL's default is a share of the machine's memory
_SORTING_SQUARE = 256  # Edge of the squares by which paths are sorted, in cells

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
    low = np.array([path.points.min(axis=0) for path in paths]) - margin
    high = np.array([path.points.max(axis=0) for path in paths]) + margin
    boxes = np.hstack((low, -high))  # so that the box around several is the least of each number
    squares = low // (_SORTING_SQUARE * info.resolution)
    members: list[int] = []
    window = np.full(4, np.inf)
    for i in np.lexsort(squares.T).tolist():
        wider = np.minimum(window, boxes[i])
        if members and _size(_cells(wider, info)) > SHARED_CELLS:
            yield members, _cells(window, info, MAX_CELLS)
            members, wider = [], boxes[i]
        members.append(i)
        window = wider
    yield members, _cells(window, info, MAX_CELLS)


def _cells(box: Floats, info: MapInfo, max_count: float = math.inf) -> Cells | None:
    """Cells that hold the ground of a box; None if these would be more than ``max_count``."""
    x_min, y_min, x_max, y_max = *box[:2], *-box[2:]
    cells = info.cells_around((x_min, x_max, y_min, y_max))
    return cells if _size(cells) <= max_count else None


def _size(cells: Cells | None) -> int:
    return 0 if cells is None else math.prod(part.stop - part.start for part in cells)


def ground_in(ground: GeotiffWindows, cells: Cells) -> ElevationMap:
    """Ground of a window, unknown cells included."""
    part = ground.info.part(*cells)
    return ElevationMap(
        elevation=ground.read(*cells),
        resolution=part.resolution,
        origin=part.origin,
        height_std=ground.height_std,
        height_std_is_assumed=ground.stated_std is None,
    )
