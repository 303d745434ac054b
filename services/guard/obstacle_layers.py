"""Obstacles of a map in the form in which swept poses ask for them: one look-up a point.

A facet is the square between four cell centres. It is as high as the highest of them, unknown if
one of them is, and an edge if one of them belongs to a step that wheels must not pass.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import SIGNIFICANCE, averaged_noise
from slopewise.models.recent import Recent
from slopewise.models.vehicle import Vehicle

SPACING = 0.1
"""Distance between the points of swept bodies [m]: an obstacle, two facets wide, is never between
them, because smaller cells are joined to blocks of that edge."""

TILE = 0.6
"""Edge of the tiles of a body that are looked up as a whole [m]: six cover that of a quad."""

HALF_DIAGONAL = 0.5 * math.sqrt(2.0) * TILE  # distance of a tile's corners from its middle [m]

_SECOND_DIFFERENCE = math.sqrt(6.0)
"""Standard deviation of z − 2 z' + z'' in that of one height [1]: the contrast of a step."""

_ROUNDING = 1e-3  # of places in single precision on maps of up to 10,000 cells [cells]

_NEAR_WHEEL = 0.5
"""Length in wheel radii over which a rise is a step rather than a slope [1]."""


class ObstacleLayers:
    """Facets and cells of one map, for one vehicle; read-only."""

    def __init__(self, ground: ElevationMap, vehicle: Vehicle) -> None:
        """Compute them; some milliseconds for a map of 300 x 300 cells."""
        self.noise = SIGNIFICANCE * averaged_noise(ground, vehicle.wheel_radius)
        elevation = ground.elevation
        self.datum = float(elevation[np.isfinite(elevation)][0])
        z: Floats = (elevation - self.datum).astype(np.float32)
        block = max(math.ceil(SPACING / ground.resolution - 1e-9), 1)
        self.cell = block * ground.resolution
        shift = 0.5 * (block - 1) * ground.resolution
        self.origin = ground.origin[0] + shift, ground.origin[1] + shift
        height = _blocks(z, block, np.nan)
        self._facets = _framed(_of_corners(height), np.nan)
        self._cells = _framed(height, np.nan)
        edges = _blocks(_edges(z, ground.resolution, vehicle, self.noise), block, 0.0)
        self._edges = _framed(_of_corners(edges), 0.0)
        blocked = np.isnan(self._facets) | (self._edges > 0.0)
        highest = np.where(blocked, np.float32(np.inf), self._facets)
        self._near = _spread(highest, HALF_DIAGONAL / self.cell)

    def heights(self, x: Floats, y: Floats, *, exact: bool) -> Floats:
        """Highest ground at points [cells from :attr:`origin`], above :attr:`datum` [m]; NaN.

        ``exact``: of the cell that holds the point, instead of the facet.
        """
        return _at(self._cells, x + 0.5, y + 0.5) if exact else _at(self._facets, x, y)

    def highest_near(self, x: Floats, y: Floats) -> Floats:
        """Highest ground within :data:`HALF_DIAGONAL` of points [cells], above the datum [m].

        Infinite near unknown ground and near steps at wheels.
        """
        return _at(self._near, x, y)

    def edges(self, x: Floats, y: Floats) -> Bools:
        """Return True at points [cells from :attr:`origin`] where a wheel would meet a step."""
        return _at(self._edges, x, y) > 0.0


def _at(layer: Floats, x: Floats, y: Floats) -> Floats:
    """Values of a framed layer; off the map those of its frame."""
    rows, columns = layer.shape
    # The frame is one wide, and truncation rounds down what is positive.
    column, row = (
        np.minimum(np.maximum(of + np.float32(1.0), 0.0), size - 1.0).astype(np.int32)
        for of, size in ((x, columns), (y, rows))
    )
    values: Floats = layer.ravel().take(row * np.int32(columns) + column)
    return values


def _framed(layer: Floats, outside: float) -> Floats:
    return np.pad(layer, 1, constant_values=outside)


def _of_corners(z: Floats) -> Floats:
    """Highest of the four cells around each facet, NaN if one is unknown."""
    rows = np.maximum(z[1:], z[:-1])
    highest: Floats = np.maximum(rows[:, 1:], rows[:, :-1])
    return highest


def _spread(layer: Floats, radius: float) -> Floats:
    """Highest value at the facets that a disc of a radius [cells] around each facet touches."""
    reach = 1 + math.floor(radius + _ROUNDING)
    rows, columns = layer.shape
    padded = np.pad(layer, reach, constant_values=np.inf)
    wide = [padded[:, reach : reach + columns]]
    for k in range(1, reach + 1):
        sides = padded[:, reach - k :][:, :columns], padded[:, reach + k :][:, :columns]
        wide.append(np.maximum(wide[-1], np.maximum(*sides)))
    highest: Floats = wide[reach][reach : reach + rows]
    for k in range(1, reach + 1):
        across = 1 + math.floor(math.sqrt(max(radius**2 - (k - 1) ** 2, 0.0)) + _ROUNDING)
        for first in (reach - k, reach + k):
            highest = np.maximum(highest, wide[min(across, reach)][first : first + rows])
    return highest


def _blocks(z: Floats, block: int, outside: float) -> Floats:
    """Highest of each block of cells, NaN if one is unknown."""
    if block == 1:
        return z
    rows, columns = (-(-size // block) for size in z.shape)
    pad = [(0, block * n - size) for n, size in zip((rows, columns), z.shape, strict=True)]
    padded = np.pad(z, pad, constant_values=outside)
    highest: Floats = padded.reshape(rows, block, columns, block).max(axis=(1, 3))
    return highest


def _edges(z: Floats, resolution: float, vehicle: Vehicle, noise: float) -> Floats:
    """1 at cells of steps up or down that wheels must not pass, 0 elsewhere.

    A step is a rise over a length beyond those over the same length before and behind: a slope
    continues on both sides. Cells larger than a wheel show none.
    """
    marked: Floats = np.zeros(z.shape, np.float32)
    if resolution > vehicle.wheel_radius:
        return marked
    highest = vehicle.shape.max_step + _SECOND_DIFFERENCE * noise
    n = math.ceil(_NEAR_WHEEL * vehicle.wheel_radius / resolution)
    for layer, to_mark in ((z, marked), (z.T, marked.T)):
        rise = layer[n:] - layer[:-n]
        slope = np.zeros_like(rise)
        before, behind = rise[: -2 * n], rise[2 * n :]
        common = np.minimum(np.abs(before), np.abs(behind))
        slope[n:-n] = np.where(before * behind > 0.0, np.copysign(common, before), 0.0)
        is_step = np.abs(rise - slope) > highest
        for k in range(n // 2, n - n // 2 + 1):  # the middle, where the step is
            part = to_mark[k : k + len(rise)]
            np.maximum(part, is_step, out=part, casting="unsafe")
    return marked


_layers: Recent[ObstacleLayers] = Recent(2)
"""Of the map in use, and of the next one, which another thread prepares."""


def obstacle_layers(ground: ElevationMap, vehicle: Vehicle) -> ObstacleLayers:
    """Obstacles of a map, the same object for the same map and vehicle."""
    return _layers.get(lambda: ObstacleLayers(ground, vehicle), ground, vehicle)
