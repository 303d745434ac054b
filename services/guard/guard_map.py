"""Ground as the guard sees it: the first map, surfaces, heights under wheels, and obstacles.

Swept bodies ask for obstacles by one look-up a point. A facet is the square between four cell
centres: as high as the highest of them, unknown if one of them is, and an edge if one of them
belongs to a step that wheels must not pass.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.averaging_windows import disc_radius
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import SIGNIFICANCE, averaged_noise
from slopewise.models.recent import Recent
from slopewise.models.vehicle import Vehicle
from slopewise.services.io import npz_map
from slopewise.services.io.files import faults_of
from slopewise.services.physics.heights import height_of, in_blocks, in_cells

_PAIRS = 10
"""Pairs of cells under a tyre [1]: a fifth of the noise of cells is left, as of a disc of 25."""

_RIM_PLACES = 3
"""Places on each side of a tyre's middle that it may rest on [1]: 6 cm apart with a quad's."""

_GOLDEN_ANGLE = 2.399963
"""Angle between neighbours that spreads points evenly over a disc [rad]."""

SPACING = 0.1
"""Distance between the points of swept bodies [m]: an obstacle, two facets wide, is never between
them, because smaller cells are joined to blocks of that edge."""

TILE = 0.5
"""Edge of the tiles of a body that are looked up as a whole [m]: 12 cover that of a quad. Where
ground may strike one, its points are looked up."""

HALF_DIAGONAL = 0.5 * math.sqrt(2.0) * TILE  # distance of a tile's corners from its middle [m]

_SECOND_DIFFERENCE = math.sqrt(6.0)
"""Standard deviation of z − 2 z' + z'' in that of one height [1]: the contrast of a step."""

_ROUNDING = 1e-3
"""Of places in single precision on maps of up to 10,000 cells [cells], and ten times that of
heights up to 1 km above the datum [m]."""

_NEAR_WHEEL = 0.5
"""Length in wheel radii over which a rise is a step rather than a slope [1]."""


def read_guard_map(path: Path) -> ElevationMap:
    """Map in an .npz file."""
    info, cells = npz_map.read_info(path), slice(None)
    layers = npz_map.read_layers(path, cells, cells, None, None)
    with faults_of(path):
        return layers.on(info)


class WheelHeights:
    """Heights as wheels feel them: means over a tyre where heights of a map have an error."""

    def __init__(self, ground: ElevationMap, vehicle: Vehicle) -> None:
        """Of one map, for the wheels of one vehicle; some milliseconds for 300 x 300 cells."""
        self._ground = ground
        self._rim = np.empty((2, 0))
        if ground.resolution > vehicle.wheel_radius:
            return
        self._rim = _rim_of(vehicle)
        if averaged_noise(ground, vehicle.wheel_radius) > 0.0:
            radius = disc_radius(ground.resolution, vehicle.wheel_radius, ground.correlation_length)
            means = _disc_means(ground.elevation, radius / ground.resolution)
            self._ground = replace(ground, elevation=means)

    def at(self, x: Floats, y: Floats) -> Floats:
        """Heights at points of any shape [m]; NaN at unknown cells and off the map."""
        return height_of(self._ground, x, y)

    def contact(self, x: Floats, y: Floats, cos: Floats, sin: Floats) -> Floats:
        """Contact heights of wheels at points with cos and sin of headings; NaN as of :meth:`at`.

        A tyre bridges a gap that ends under its rim on both sides. The edge of a drop does not
        support it.
        """
        surface = self.at(x, y)
        behind, ahead = np.full_like(surface, -np.inf), np.full_like(surface, -np.inf)
        for away, rise in self._rim.T:
            for s, highest in ((-away, behind), (away, ahead)):
                under_rim = self.at(x + s * cos, y + s * sin) - rise
                np.fmax(highest, under_rim, out=highest)
        return np.maximum(surface, np.minimum(behind, ahead))


def _disc_means(z: Floats, radius: float) -> Floats:
    """Mean heights of cells spread over a disc around each cell; NaN at unknown cells.

    Pairs of cells on opposite sides count if both are known, so that a slope cancels.
    """
    n = np.arange(1, _PAIRS + 1)
    away, angle = radius * np.sqrt(n / _PAIRS), _GOLDEN_ANGLE * n
    places = np.rint((away * np.sin(angle), away * np.cos(angle))).astype(int).T
    reach, (rows, columns) = int(np.abs(places).max()), z.shape
    padded = np.pad(z, reach, constant_values=np.nan)
    total, count = z.copy(), np.ones_like(z)
    for i, j in {max((i, j), (-i, -j)) for i, j in places.tolist()} - {(0, 0)}:
        pair = np.zeros_like(z)
        for row, column in ((reach + i, reach + j), (reach - i, reach - j)):
            pair += padded[row : row + rows, column : column + columns]
        known = np.isfinite(pair)
        np.add(total, pair, out=total, where=known)
        count += 2.0 * known
    means: Floats = total / count
    return means


def _rim_of(vehicle: Vehicle) -> Floats:
    """(2, places) distances from a wheel's lowest point and the rim's height there [m].

    Up to where the rim is higher than any step that the wheel may climb.
    """
    radius = vehicle.wheel_radius
    reach = np.sqrt(radius**2 - max(radius - vehicle.shape.max_step, 0.0) ** 2)
    away = reach * np.arange(1, _RIM_PLACES + 1) / _RIM_PLACES
    return np.array([away, radius - np.sqrt(radius**2 - away**2)])


class ObstacleLayers:
    """Facets and cells of one map, for one vehicle; read-only."""

    def __init__(self, ground: ElevationMap, vehicle: Vehicle) -> None:
        """Compute them; some milliseconds for a map of 300 x 300 cells."""
        self.noise = SIGNIFICANCE * averaged_noise(ground, vehicle.wheel_radius)
        elevation = ground.elevation
        self.datum = float(elevation[np.isfinite(elevation)][:1].sum())  # 0 if all are unknown
        z: Floats = (elevation - self.datum).astype(np.float32)
        block = max(math.ceil(SPACING / ground.resolution - 1e-9), 1)
        self.cell = block * ground.resolution
        shift = 0.5 * (block - 1) * ground.resolution
        shift -= self.cell  # to the frame
        self.origin = ground.origin[0] + shift, ground.origin[1] + shift
        height = in_blocks(z, block).max(axis=(1, 3))  # unknown where one of its cells is
        self._facets = _framed(_of_corners(height), np.nan)
        self._cells = _framed(height, np.nan)
        edges = _edges(z, ground.resolution, vehicle, self.noise, ground.correlation_length)
        edges = _of_corners(in_blocks(edges, block, 0.0).max(axis=(1, 3)))
        self._edges = _framed(edges > 0.0, False)
        blocked = np.isnan(self._facets) | self._edges
        highest = np.where(blocked, np.float32(np.inf), self._facets + np.float32(_ROUNDING))
        self._near = _spread(highest, HALF_DIAGONAL / self.cell)

    def facets(self, x: Floats, y: Floats) -> tuple[Floats, Bools]:
        """Facets at points [cells from :attr:`origin`]: highest ground, above :attr:`datum` [m].

        NaN where unknown; and whether a wheel would meet a step.
        """
        at = _places(self._facets, x, y)
        return self._facets.take(at), self._edges.take(at)

    def cells(self, x: Floats, y: Floats) -> Floats:
        """Ground of the cells that hold points, as of :meth:`facets`."""
        ground: Floats = self._cells.take(_places(self._cells, x + 0.5, y + 0.5))
        return ground

    def highest_near(self, x: Floats, y: Floats) -> Floats:
        """Highest ground within :data:`HALF_DIAGONAL` of points [cells], above the datum [m].

        Infinite near unknown ground and near steps at wheels.
        """
        return self._near.take(_places(self._near, x, y))

    def place(self, x: Floats | float, y: Floats | float) -> tuple[float, float]:
        """Place on the map [m] of a point [cells from :attr:`origin`]."""
        return float(self.origin[0] + self.cell * x), float(self.origin[1] + self.cell * y)


def _places(layer: Floats, x: Floats, y: Floats) -> Ints:
    """Places of finite points in a framed layer, row by row; off the map those of its frame."""
    rows, columns = layer.shape
    # Clipped as numbers of the points' precision: half the time of clipping indices.
    row, column = np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)
    places: Ints = row.astype(np.int32) * columns + column.astype(np.int32)
    return places


def _framed(layer: Any, outside: float) -> Any:
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


def _edges(
    z: Floats, resolution: float, vehicle: Vehicle, noise: float, correlation_length: float
) -> Floats:
    """1 at cells of steps up or down that wheels must not pass, 0 elsewhere.

    A step is a rise over a length beyond those over the same length before and behind: a slope
    continues on both sides. Cells larger than a wheel show none. Where errors of cells are
    independent, with a ``correlation_length`` below a cell [m], a lower one shows in means of
    blocks that lie as far apart as their own length: an oblique edge is between them, too.
    """
    marked: Floats = np.zeros(z.shape, np.float32)
    if resolution > vehicle.wheel_radius:
        return marked
    limit, scatter = vehicle.shape.max_step, _SECOND_DIFFERENCE * noise
    n = math.ceil(_NEAR_WHEEL * vehicle.wheel_radius / resolution)
    for layer, to_mark in ((z, marked), (z.T, marked.T)):
        is_step = _rises_beyond(layer, n) > limit + scatter
        for k in range(n // 2, n - n // 2 + 1):  # the middle, where the step is
            part = to_mark[k : k + len(is_step)]
            np.maximum(part, is_step, out=part, casting="unsafe")
        if noise > 0.0 and correlation_length < resolution and min(layer.shape) > 7 * n:
            block = n, n + 1
            means = sliding_window_view(layer, block).mean(axis=(2, 3))
            is_step = _rises_beyond(means, 2 * n) > limit + scatter / math.sqrt(math.prod(block))
            for k in range(n, 2 * n):  # between the two blocks
                part = to_mark[k : k + len(is_step), block[1] // 2 :][:, : is_step.shape[1]]
                np.maximum(part, is_step, out=part, casting="unsafe")
    return marked


def _rises_beyond(z: Floats, n: int) -> Floats:
    """Rises over n rows, without what rises before and behind have in common [m]."""
    rise = z[n:] - z[:-n]
    slope = np.zeros_like(rise)
    before, behind = rise[: -2 * n], rise[2 * n :]
    common = np.minimum(np.abs(before), np.abs(behind))
    slope[n:-n] = np.where(before * behind > 0.0, np.copysign(common, before), 0.0)
    return np.abs(rise - slope)


class MapLayers(NamedTuple):
    """Obstacles and heights of one map that decisions look up, for one vehicle."""

    obstacles: ObstacleLayers
    wheels: WheelHeights


_layers: Recent[MapLayers] = Recent(2)
"""Of the map in use, and of the next one, which another thread prepares."""


def map_layers(ground: ElevationMap, vehicle: Vehicle) -> MapLayers:
    """Layers of a map, the same object for the same map and vehicle."""
    return _layers.get(
        lambda: MapLayers(ObstacleLayers(ground, vehicle), WheelHeights(ground, vehicle)),
        ground,
        vehicle,
    )


def classes_at(ground: ElevationMap, x: Floats, y: Floats) -> Ints:
    """Indices into ``class_names`` at points (4, N, S); off the map those of the nearest cell.

    (1, N, S) where a map has one class.
    """
    if ground.terrain_class is None:
        return np.zeros((1, *np.shape(x)[1:]), np.int64)
    rows, columns = ground.elevation.shape
    u, v = in_cells(ground, x, y)
    i, j = np.clip(np.rint(v), 0, rows - 1), np.clip(np.rint(u), 0, columns - 1)
    indices: Ints = ground.terrain_class[i.astype(np.int64), j.astype(np.int64)]
    return indices
