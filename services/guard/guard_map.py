"""Ground as the guard sees it: the first map, heights and surfaces at points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.averaging_windows import disc_radius
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import averaged_noise
from slopewise.models.recent import Recent
from slopewise.models.vehicle import Vehicle
from slopewise.services.io import npz_map
from slopewise.services.io.files import faults_of
from slopewise.services.physics.heights import height_of, in_cells

_PAIRS = 10
"""Pairs of cells under a tyre [1]: a fifth of the noise of cells is left, as of a disc of 25."""

_RIM_PLACES = 3
"""Places on each side of a tyre's middle that it may rest on [1]: 6 cm apart with a quad's."""

_GOLDEN_ANGLE = 2.399963
"""Angle between neighbours that spreads points evenly over a disc [rad]."""


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


_wheel_heights: Recent[WheelHeights] = Recent(2)
"""Of the map in use, and of the next one, which another thread prepares."""


def wheel_heights(ground: ElevationMap, vehicle: Vehicle) -> WheelHeights:
    """Heights as the wheels of one vehicle feel them [m], the same object for the same map."""
    return _wheel_heights.get(lambda: WheelHeights(ground, vehicle), ground, vehicle)


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
