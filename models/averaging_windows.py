"""Windows over which heights of a map may be averaged, and contrasts that show where they may not.

A tyre rests on an area of about its radius, not on a cell. So the height under a wheel is that of
the plane nearest to the heights within a disc of that radius, unless they hold more than noise: a
step, a ridge, a rock, a post. Contrasts find those. Each is a weighted sum of heights that is 0 on
every plane, with the least variance under the noise that a sum with its meaning can have: a
coefficient of a least squares fit, or the difference of a mean and a plane.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats

_DIRECTIONS = 8
"""Directions of jumps and ridges within half a turn [1]: to 11° of any edge."""

_MIN_CELLS = 2.9
"""Radius of a disc at least, in cells: 25 of them, so that noise of one is a fifth in the mean."""

_CORRELATED = 2.5
"""Least radius of a disc, in lengths over which the error is correlated [1]."""

_FINEST = 10.0
"""Cells along the radius of a disc [1]: of finer cells, every second, third, … is averaged. More
would reduce noise that is below a tenth already, in a time that grows without a limit."""

_FARTHEST = 1.0
"""Largest radius of a disc that a correlated error calls for [m]: ground farther away is not under
a tyre, and windows of a stated length without a limit would have cells without a limit."""

_WIDE = 2.0
"""Radius within which contrasts are taken, in wheel radii."""

_BLOCKS = 5.0
"""Blocks within that radius at least [1]: contrasts of finer cells are taken of means of blocks."""


_MIN_VARIANCE = 1e-12
"""Variance of a sum at least [1]: rounding may leave less than nothing of a correlated error."""


class Taps(NamedTuple):
    """Cells around a cell: rows and columns from it, (T,) int32 each."""

    row: np.ndarray
    column: np.ndarray


class Contrasts(NamedTuple):
    """K contrasts over the same T cells; the first are jumps.

    Attributes:
        taps: cells. weights: (K, T) float32, 0 on every plane.
        std: (K,) float32 standard deviations for noise of standard deviation 1.
        slopes: (2, jumps, T) float32: rise a cell to the east and to the north, on both sides of a
            jump.
    """

    taps: Taps
    weights: np.ndarray
    std: np.ndarray
    slopes: np.ndarray


class AveragingWindows(NamedTuple):
    """Windows and contrasts of a map for a wheel.

    Attributes:
        wide: contrasts of blocks of ``stride`` × ``stride`` cells. narrow: of single cells.
        taps: cells of the windows one behind the other, the disc last.
        start: (W + 1,) int32, where each begins.
        variance: (W,) of their means, for noise of variance 1.
        stride: see ``wide``. block_std: standard deviation of a block's mean, for noise of 1 [1].
        reach: farthest cell or block [1].
    """

    wide: Contrasts
    narrow: Contrasts
    taps: Taps
    start: np.ndarray
    variance: Floats
    stride: int
    block_std: float
    reach: int


class _Grid(NamedTuple):
    """Square of cells: rows and columns from the one in the middle, correlation of their errors."""

    row: Floats
    column: Floats
    edge: float
    correlation: float

    @property
    def distance(self) -> Floats:
        """From the cell in the middle [m]."""
        return np.hypot(self.row, self.column) * self.edge

    def along(self, direction: int) -> Floats:
        """Coordinate of cells in one of the directions, in cells."""
        angle = math.pi * direction / _DIRECTIONS
        return np.round(self.row * math.sin(angle) + self.column * math.cos(angle), 9)

    def variance(self, weights: Floats) -> float:
        """Of a weighted sum, for noise of variance 1."""
        if self.correlation <= 0.0:
            return float(weights @ weights)
        # The correlation is a product of one along rows and one along columns.
        side = math.isqrt(len(weights))
        place = np.arange(side) * self.edge / self.correlation
        shared = np.exp(-0.5 * (place[:, None] - place[None, :]) ** 2)
        square = weights.reshape(side, side)
        return max(float((square * (shared @ square @ shared)).sum()), _MIN_VARIANCE)


def _grid(reach: int, edge: float, correlation: float) -> _Grid:
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(float)
    return _Grid(row.ravel(), column.ravel(), edge, correlation)


def _coefficients(columns: list[Floats], inside: Bools) -> Floats:
    """(columns, T) weights that give each coefficient of a least squares fit to cells."""
    weights = np.zeros((len(columns), len(inside)))
    weights[:, inside] = np.linalg.pinv(np.stack([c[inside] for c in columns], axis=1))
    return weights


def disc_radius(resolution: float, wheel_radius: float, correlation: float = 0.0) -> float:
    """Radius of the disc whose mean is the height under a wheel [m]; lengths [m]."""
    return max(wheel_radius, _MIN_CELLS * resolution, min(_CORRELATED * correlation, _FARTHEST))


@lru_cache(maxsize=32)
def averaging_windows(
    resolution: float, wheel_radius: float, correlation: float = 0.0
) -> AveragingWindows:
    """Windows and contrasts of a map for a wheel.

    Args:
        resolution: edge of a cell [m]. wheel_radius: [m].
        correlation: length over which errors of cells are alike [m]; the correlation of two at a
            distance d is exp(-d² / 2 L²), 0 for none.
    """
    disc = disc_radius(resolution, wheel_radius, correlation)
    wide = max(_WIDE * wheel_radius, disc)
    stride = max(int(wide / (resolution * _BLOCKS)), 1)
    edge = stride * resolution
    blocks = _grid(int(wide / edge + 1e-9), edge, correlation)
    every = max(int(disc / (resolution * _FINEST)), 1)
    cells = _grid(int(disc / (resolution * every) + 1e-9), resolution * every, correlation)
    rows, columns = np.mgrid[:stride, :stride].astype(float)
    block = _Grid(rows.ravel(), columns.ravel(), resolution, correlation)
    windows = _windows(cells, disc, wheel_radius)
    start = np.concatenate(([0], np.cumsum([w.sum() for w in windows])))
    row, column = (
        every * np.concatenate([axis[w] for w in windows]) for axis in (cells.row, cells.column)
    )
    shares = [w / w.sum() for w in windows]
    near = _grid(2, resolution, correlation)
    return AveragingWindows(
        _wide_contrasts(blocks, wide, wheel_radius),
        _contrasts(near, [_one_cell(near)], np.empty((2, 0, len(near.row)))),
        _taps(row, column),
        start.astype(np.int32),
        np.array([cells.variance(share) for share in shares]),
        stride,
        math.sqrt(block.variance(np.full(len(block.row), 1.0 / len(block.row)))),
        int(max(blocks.row.max(), -(-row.max() // stride), 2)),
    )


def _taps(row: Floats, column: Floats) -> Taps:
    return Taps(row.astype(np.int32), column.astype(np.int32))


def _contrasts(grid: _Grid, weights: list[Floats], slopes: Floats) -> Contrasts:
    """Without the cells that have a weight in no contrast."""
    table = np.array(weights)
    used = np.any(table != 0.0, axis=0)
    std = np.sqrt([grid.variance(w) for w in weights])
    return Contrasts(
        _taps(grid.row[used], grid.column[used]),
        np.ascontiguousarray(table[:, used], np.float32),
        std.astype(np.float32),
        np.ascontiguousarray(slopes[:, :, used], np.float32),
    )


def _one_cell(grid: _Grid) -> Floats:
    """A cell against the plane of those around it."""
    middle = grid.distance == 0.0
    plane = _coefficients([np.ones_like(grid.row), grid.column, grid.row], ~middle)[0]
    return np.asarray(middle - plane, np.float64)


def _wide_contrasts(grid: _Grid, radius: float, wheel_radius: float) -> Contrasts:
    """Jumps, ridges and a block of the size of a wheel, each against what is around it."""
    ones, inside = np.ones_like(grid.row), grid.distance <= radius + 1e-9
    fits = [
        _coefficients([ones, grid.column, grid.row, 0.5 * np.sign(grid.along(n))], inside)
        for n in range(_DIRECTIONS)
    ]
    weights = [fit[3] for fit in fits]
    half = 0.25 * wheel_radius / grid.edge
    for n in range(_DIRECTIONS):
        away = np.abs(grid.along(n))
        near = grid.distance <= 0.5 * (radius + grid.edge)
        ridge = near & (away <= max(0.5, half))
        sides = inside & (away > max(1.0, half + 0.5))
        plane = _coefficients([ones, grid.column, grid.row], sides)[0]
        weights.append(ridge / ridge.sum() - plane)
    side = max(round(0.5 * wheel_radius / grid.edge), 1)
    block = (np.abs(grid.row) <= side) & (np.abs(grid.column) <= side)
    if (inside & ~block).sum() >= len(block) // 4:
        plane = _coefficients([ones, grid.column, grid.row], inside & ~block)[0]
        weights.append(block / block.sum() - plane)
    slopes = np.array([[fit[1] for fit in fits], [fit[2] for fit in fits]])
    return _contrasts(grid, weights, slopes)


def _windows(grid: _Grid, disc: float, wheel_radius: float) -> list[Bools]:
    """Ridges, halves of the disc, squares of the size of a wheel; the disc last."""
    inside = grid.distance <= disc + 1e-9
    half = max(0.5, 0.25 * wheel_radius / grid.edge)
    windows = [inside & (np.abs(grid.along(n)) <= half) for n in range(_DIRECTIONS)]
    windows += [inside & (grid.along(n) >= -0.5) for n in range(2 * _DIRECTIONS)]
    side = round(0.5 * wheel_radius / grid.edge)
    if side > 0:
        for row in (-side, 0, side):
            for column in (-side, 0, side):
                square = np.abs(grid.row - row) <= side
                windows.append(square & (np.abs(grid.column - column) <= side))
    return [w for w in windows if w.sum() > 1] + [inside]
