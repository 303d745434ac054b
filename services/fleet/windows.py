"""Windows of a large map: which paths share one, and the ground in it.

Memory is bounded by the window, whatever the size of the map. Paths that lie close together share a
window, so that tiles are not decoded again for every path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.io import geotiff
from slopewise.services.io.geotiff import GeotiffWindows
from slopewise.services.io.map_grid import Around, MapInfo
from slopewise.services.io.no_data import NoData

SHARED_CELLS = 1_000_000
"""Cells up to which paths share a window: 8 MB of heights."""

MOST_CELLS = 8_000_000
"""Cells that a single path may need: 64 MB of heights, 2.8 km x 2.8 km at 1 m."""

_BLOCK_CACHE = 64  # [MB] of decoded tiles; GDAL's own default is a share of the machine's memory
_NEAR = 256  # cells: the edge of the squares by which paths are put in order


@dataclass(frozen=True, slots=True)
class MapWindow:
    """Paths by their index, and the cells that hold their ground; None if those are too many."""

    members: tuple[int, ...]
    cells: tuple[slice, slice] | None


@contextmanager
def opened(path: Path, nodata: NoData = None) -> Iterator[GeotiffWindows]:
    """A map to read windows of, with a small cache of tiles.

    Raises:
        InputError: not a GeoTIFF in metres.
    """
    import rasterio

    with rasterio.Env(GDAL_CACHEMAX=_BLOCK_CACHE), geotiff.opened(path, nodata) as ground:
        yield ground


def windows(paths: Sequence[CandidatePath], info: MapInfo, margin: float) -> list[MapWindow]:
    """Paths put together by place.

    Args:
        paths: that begin on the map. info: grid of the map.
        margin: what the footprint needs around a path [m].
    """
    around = [_around(path, margin) for path in paths]
    edge = _NEAR * info.resolution
    order = sorted(range(len(paths)), key=lambda i: (around[i][2] // edge, around[i][0] // edge, i))
    found: list[MapWindow] = []
    members: list[int] = []
    union: Around | None = None
    for i in order:
        wider = around[i] if union is None else _union(union, around[i])
        if union is not None and _size(info, wider) > SHARED_CELLS:
            found.append(_window(members, union, info))
            members, wider = [], around[i]
        members.append(i)
        union = wider
    if union is not None:
        found.append(_window(members, union, info))
    return found


def ground_in(ground: GeotiffWindows, cells: tuple[slice, slice]) -> ElevationMap:
    """The ground of a window, unknown cells and all."""
    part = ground.info.part(*cells)
    heights = ground.read(*cells)
    if not np.isfinite(heights).any():
        heights = _with_a_known_cell(heights)
    return ElevationMap(
        elevation=heights,
        resolution=part.resolution,
        origin=part.origin,
        height_std=ground.height_std,
    )


def _with_a_known_cell(heights: Floats) -> Floats:
    """A map has a known cell: here it is put behind the window, where no path and wheel comes."""
    beyond = np.full((2, heights.shape[1]), np.nan)
    beyond[-1, -1] = 0.0
    return np.concatenate((heights, beyond))


def _around(path: CandidatePath, margin: float) -> Around:
    (x_min, y_min), (x_max, y_max) = path.points.min(axis=0), path.points.max(axis=0)
    return x_min - margin, x_max + margin, y_min - margin, y_max + margin


def _union(a: Around, b: Around) -> Around:
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])


def _size(info: MapInfo, around: Around) -> int:
    cells = info.cells_around(around)
    if cells is None:
        return 0
    rows, columns = cells
    return int((rows.stop - rows.start) * (columns.stop - columns.start))


def _window(members: list[int], around: Around, info: MapInfo) -> MapWindow:
    fits = 0 < _size(info, around) <= MOST_CELLS
    return MapWindow(tuple(members), info.cells_around(around) if fits else None)
