"""Where a map's cells lie: what can be known without reading its heights."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.errors import ParameterError
from slopewise.models.vehicle import Vehicle

Around = tuple[float, float, float, float]
"""(x_min, x_max, y_min, y_max) [m] in map coordinates."""

MAX_CELLS = 100_000_000
"""Cells read at once: 10 km x 10 km at 1 m, 0.8 GB of heights."""

_FEWEST = 2
_FINEST, _COARSEST = 1e-3, 1e3
_FARTHEST = 1e8


@dataclass(frozen=True, slots=True)
class MapInfo:
    """The grid of a map; cell [row, column] has its centre at origin + resolution * (column, row).

    Attributes:
        rows, columns: number of cells; row 0 is at minimum y.
        resolution: edge of a cell [m].
        origin: (x, y) of the centre of cell [0, 0] [m].
    """

    rows: int
    columns: int
    resolution: float
    origin: tuple[float, float]

    @property
    def extent(self) -> Around:
        """(x_min, x_max, y_min, y_max) of the cell centres [m]."""
        x, y = self.origin
        width, height = (self.columns - 1) * self.resolution, (self.rows - 1) * self.resolution
        return x, x + width, y, y + height

    def cells_around(self, around: Around) -> tuple[slice, slice] | None:
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
    """Cells from one before ``low`` to one after ``high``: rounding must not cost a neighbour."""
    first = max(math.floor((low - origin) / resolution) - 1, 0)
    last = min(math.ceil((high - origin) / resolution) + 1, count - 1)
    if last - first + 1 < _FEWEST:
        return None
    return slice(first, last + 1)


def check_physical(resolution: float, origin: tuple[float, float], shape: tuple[int, ...]) -> None:
    """Whether cells can be of a map that robots drive on, in metres on this earth.

    Raises:
        ParameterError: names what is out of range.
    """
    if not _FINEST <= resolution <= _COARSEST:
        words = f"{_FINEST:g} … {_COARSEST:g} m from cell to cell, got {resolution:g}"
        raise ParameterError("resolution", words)
    ends = (origin[0] + shape[1] * resolution, origin[1] + shape[0] * resolution)
    # NaN is never within anything.
    if not all(abs(value) <= _FARTHEST for value in (*origin, *ends)):
        words = f"coordinates of at most {_FARTHEST:g} m, got {origin[0]:g}, {origin[1]:g}"
        raise ParameterError("origin", words)


def in_words(extent: Around) -> str:
    """An extent as an error shows it."""
    x_min, x_max, y_min, y_max = extent
    return f"x {x_min:.10g} … {x_max:.10g}, y {y_min:.10g} … {y_max:.10g} m"


def footprint_margin(vehicle: Vehicle, info: MapInfo) -> float:
    """Ground that has to be known around a path [m]."""
    return vehicle.wheelbase + vehicle.track_width + 2.0 * info.resolution
