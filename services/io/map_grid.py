"""Grid of a map: where its cells lie, known without reading its heights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.vehicle import Vehicle

Extent = tuple[float, float, float, float]
"""(x_min, x_max, y_min, y_max) in map coordinates [m]."""

MAX_CELLS = 100_000_000  # cells read together: 10 km x 10 km at 1 m, 0.8 GB of heights
_MIN_CELLS = 2  # cells of a row or column with ground between them

_MIN_RESOLUTION, _MAX_RESOLUTION = 1e-3, 1e3
"""Plausible edges of a cell [m]: beyond them the file is in millimetres or degrees."""

_MAX_COORDINATE = 1e8
"""Largest coordinate of a map [m]: no projection of this earth reaches 40,000 km."""


@dataclass(frozen=True, slots=True)
class MapInfo:
    """Grid of a map; cell [row, column] has its centre at origin + resolution · (column, row)."""

    rows: int  # row 0 is at minimum y
    columns: int
    resolution: float  # edge of a cell [m]
    origin: tuple[float, float]  # (x, y) of the centre of cell [0, 0] [m]

    @property
    def extent(self) -> Extent:
        """(x_min, x_max, y_min, y_max) of the cell centres [m]."""
        x, y = self.origin
        width, height = (self.columns - 1) * self.resolution, (self.rows - 1) * self.resolution
        return x, x + width, y, y + height

    def cells_around(self, around: Extent) -> tuple[slice, slice] | None:
        """(rows, columns) that hold every height within ``around``; None if it is off the map."""
        x_min, x_max, y_min, y_max = around
        rows = _cells(y_min, y_max, self.origin[1], self.resolution, self.rows)
        columns = _cells(x_min, x_max, self.origin[0], self.resolution, self.columns)
        return None if rows is None or columns is None else (rows, columns)

    def part(self, rows: slice, columns: slice) -> MapInfo:
        """The grid of some of the cells."""
        x = self.origin[0] + columns.start * self.resolution
        y = self.origin[1] + rows.start * self.resolution
        height, width = rows.stop - rows.start, columns.stop - columns.start
        return MapInfo(height, width, self.resolution, (x, y))


def _cells(low: float, high: float, origin: float, resolution: float, count: int) -> slice | None:
    """Cells from one before ``low`` to one after ``high``, so that rounding loses none."""
    first = max(math.floor((low - origin) / resolution) - 1, 0)
    last = min(math.ceil((high - origin) / resolution) + 1, count - 1)
    if last - first + 1 < _MIN_CELLS:
        return None
    return slice(first, last + 1)


def check_physical(resolution: float, origin: tuple[float, float], shape: tuple[int, ...]) -> None:
    """Raise ParameterError where resolution or position show that a grid is not in metres."""
    if not _MIN_RESOLUTION <= resolution <= _MAX_RESOLUTION:
        span = f"{_MIN_RESOLUTION:g} … {_MAX_RESOLUTION:g} m from cell to cell"
        raise ParameterError("resolution", f"{span}, got {resolution:g}")
    ends = (origin[0] + shape[1] * resolution, origin[1] + shape[0] * resolution)
    # Written so that NaN fails.
    if not all(abs(value) <= _MAX_COORDINATE for value in (*origin, *ends)):
        expected = f"coordinates of at most {_MAX_COORDINATE:g} m, got {origin[0]:g}, {origin[1]:g}"
        raise ParameterError("origin", expected)


def describe_extent(extent: Extent) -> str:
    """Format an extent for an error message."""
    x_min, x_max, y_min, y_max = extent
    return f"x {x_min:.10g} … {x_max:.10g}, y {y_min:.10g} … {y_max:.10g} m"


def footprint_margin(vehicle: Vehicle, info: MapInfo) -> float:
    """Width of the strip around a path whose ground a plan reads [m]."""
    return vehicle.wheelbase + vehicle.track_width + 2.0 * info.resolution


class MapLayers(NamedTuple):
    """Heights and surfaces of some cells of a map, (rows, columns) each."""

    heights: Floats  # [m], NaN where unknown
    height_std: float  # error of the heights of cells relative to each other [m], one for all
    assumed: tuple[str, ...] = ()  # assumptions about the file, as sentences
    classes: Ints | None = None  # index into ``class_names``, None for the base surface everywhere
    class_names: tuple[str, ...] = ("",)
    std_is_assumed: bool = False  # the source states no error
    correlation_length: float = 0.0  # distance over which errors of cells are alike [m]

    def on(self, grid: MapInfo) -> ElevationMap:
        """The map of these layers, whose cells are those of a grid."""
        return ElevationMap(
            elevation=self.heights,
            resolution=grid.resolution,
            origin=grid.origin,
            terrain_class=self.classes,
            class_names=self.class_names,
            height_std=self.height_std,
            height_std_is_assumed=self.std_is_assumed,
            correlation_length=self.correlation_length,
            assumed=self.assumed,
        )
