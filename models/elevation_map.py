"""Elevation map: heights on a regular grid, unknown where nothing was seen.

Cell [row, col] has its centre at ``origin + resolution * (col, row)``: row 0 is at minimum y.
Heights between centres are bilinear; a point is known only if all four cells around it are.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Floats, Ints, read_only
from slopewise.models.errors import ParameterError
from slopewise.models.typed_arguments import check_fields

MAX_HEIGHT = 1e5
"""From here on, up and down, no number is a height of ground [m]: float32's lowest, 1e20."""

_MAX_COORDINATE = 1e8
"""Positions are within that [m]: of no projection farther, and there they are exact to 15 nm."""

_RESOLUTIONS = (1e-3, 1e4)
"""Edges of cells [m]: from finer than any sensor to coarser than any vehicle's path."""

_MIN_CELL_COUNT = 2
"""Cells along an edge that bilinear heights need [1]."""

_MAX_CLASS_COUNT = 63
"""Classes of terrain [1]: a station's are bits of one signed integer."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ElevationMap:
    """Heights [m] on a grid, NaN where unknown.

    Attributes:
        elevation: (rows, cols) heights, row 0 at minimum y; NaN is unknown ground.
        resolution: edge of a cell [m].
        origin: (x, y) of the centre of cell [0, 0] [m].
        terrain_class: (rows, cols) index into ``class_names``, or None without classes.
        class_names: name of each class; index 0 is the base surface.
        height_std: error of the heights of cells against each other [m], one for all.
        height_std_is_assumed: its source does not state it; the heights themselves may
            show a smaller one.
        correlation_length: over which errors of cells are alike [m]: of two at a distance d their
            correlation is exp(-d² / 2 L²). 0: errors are independent.
        assumed: assumptions made of its source, in sentences.
    """

    elevation: Floats
    resolution: float
    origin: tuple[float, float]
    terrain_class: Ints | None = None
    class_names: tuple[str, ...] = field(default=("",))
    height_std: float = 0.0
    height_std_is_assumed: bool = False
    correlation_length: float = 0.0
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        elevation = _known_heights(self.elevation)
        finest, coarsest = _RESOLUTIONS
        if not finest <= self.resolution <= coarsest:
            raise ParameterError(
                "resolution",
                f"a cell edge of {finest:g} m … {coarsest:g} m, got {self.resolution!r}",
            )
        if np.shape(self.origin) != (2,) or not np.all(np.abs(self.origin) <= _MAX_COORDINATE):
            raise ParameterError(
                "origin", f"two coordinates within ±{_MAX_COORDINATE:g} m, got {self.origin!r}"
            )
        # An error that all cells share is correlated over as far as positions reach.
        for name, greatest in (("height_std", MAX_HEIGHT), ("correlation_length", _MAX_COORDINATE)):
            length = getattr(self, name)
            if not 0.0 <= length <= greatest:
                raise ParameterError(name, f"a length of 0 m … {greatest:g} m, got {length!r}")
            object.__setattr__(self, name, float(length))
        x, y = self.origin
        object.__setattr__(self, "origin", (float(x), float(y)))
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "elevation", read_only(elevation))
        if len(self.class_names) > _MAX_CLASS_COUNT:
            raise ParameterError(
                "class_names", f"at most {_MAX_CLASS_COUNT} names, got {len(self.class_names)}"
            )
        if self.terrain_class is not None:
            classes = _whole_numbers(self.terrain_class)
            if classes.shape != elevation.shape:
                raise ParameterError(
                    "terrain_class",
                    f"the shape of elevation {elevation.shape}, got {classes.shape}",
                )
            if classes.min() < 0 or classes.max() >= len(self.class_names):
                raise ParameterError(
                    "terrain_class", f"indices 0 … {len(self.class_names) - 1} into class_names"
                )
            object.__setattr__(self, "terrain_class", read_only(classes))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(x_min, x_max, y_min, y_max) of the cell centres [m]."""
        rows, cols = self.elevation.shape
        x, y = self.origin
        return x, x + (cols - 1) * self.resolution, y, y + (rows - 1) * self.resolution

    def contains(self, x: Floats, y: Floats) -> np.ndarray:
        """Which points x, y (any shape) [m] lie on the grid, known or not."""
        x_min, x_max, y_min, y_max = self.extent
        return (x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)


def _whole_numbers(classes: Ints) -> Ints:
    """A copy of indices of classes (rows, cols)."""
    if np.ma.is_masked(classes):
        raise ParameterError("terrain_class", "a class in every cell, got masked ones")
    given = np.asarray(classes)
    if given.dtype.kind not in "biu":
        given = given.astype(np.float64)
        if not np.array_equal(given, np.floor(given)):  # NaN is never equal
            raise ParameterError("terrain_class", "whole numbers")
    return np.array(given, dtype=np.int64, order="C")


def _known_heights(heights: Floats) -> Floats:
    """A copy of heights (rows, cols) with NaN for infinite and masked ones [m]."""
    elevation = np.array(heights, dtype=np.float64, order="C")
    if elevation.ndim != 2 or min(elevation.shape) < _MIN_CELL_COUNT:
        raise ParameterError(
            "elevation", f"at least 2 x 2 cells (rows, cols), got shape {elevation.shape}"
        )
    elevation[np.isinf(elevation) | np.ma.getmask(heights)] = np.nan
    largest = max(np.fmax.reduce(elevation, axis=None), -np.fmin.reduce(elevation, axis=None))
    if largest >= MAX_HEIGHT:
        row, column = np.argwhere(np.abs(elevation) >= MAX_HEIGHT)[0]
        raise ParameterError(
            f"elevation[{row}, {column}]",
            f"a height within ±{MAX_HEIGHT:g} m, or NaN where the ground is unknown, "
            f"got {elevation[row, column]:g}",
        )
    return elevation
