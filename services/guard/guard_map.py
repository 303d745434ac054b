"""Ground as the guard sees it: the first map, heights and surfaces at points."""

from __future__ import annotations

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
"""Pairs of places on a tyre [1]: a fifth of the noise of cells is left, as of a disc of 25."""

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
    """Heights as wheels feel them: means over a tyre where heights of a map have an error.

    Pairs of places on opposite sides of a point count if both are known, so that a slope cancels.
    """

    def __init__(self, ground: ElevationMap, vehicle: Vehicle) -> None:
        """Of one map, for the wheels of one vehicle."""
        self._ground = ground
        self._pairs = np.empty((2, 0))
        self._rim = np.empty((2, 0))
        if ground.resolution > vehicle.wheel_radius:
            return
        self._rim = _rim_of(vehicle)
        if averaged_noise(ground, vehicle.wheel_radius) > 0.0:
            radius = disc_radius(ground.resolution, vehicle.wheel_radius, ground.correlation_length)
            n = np.arange(1, _PAIRS + 1)
            away, angle = radius * np.sqrt(n / _PAIRS), _GOLDEN_ANGLE * n
            self._pairs = np.array([away * np.cos(angle), away * np.sin(angle)])

    def at(self, x: Floats, y: Floats) -> Floats:
        """Heights at points of any shape [m]; NaN at unknown cells and off the map."""
        total = height_of(self._ground, x, y)
        count = np.ones_like(total)
        for east, north in self._pairs.T:
            pair = height_of(self._ground, x + east, y + north)
            pair = pair + height_of(self._ground, x - east, y - north)
            known = np.isfinite(pair)
            total = total + np.where(known, pair, 0.0)
            count = count + 2.0 * known
        return total / count

    def contact(self, x: Floats, y: Floats, yaw: Floats) -> Floats:
        """Contact heights of wheels at points with headings [m]; NaN as of :meth:`at`.

        A tyre bridges a gap that ends under its rim on both sides. The edge of a drop does not
        support it.
        """
        surface = self.at(x, y)
        behind, ahead = np.full_like(surface, -np.inf), np.full_like(surface, -np.inf)
        for away, rise in self._rim.T:
            for s, highest in ((-away, behind), (away, ahead)):
                under_rim = self.at(x + s * np.cos(yaw), y + s * np.sin(yaw)) - rise
                np.fmax(highest, under_rim, out=highest)
        return np.maximum(surface, np.minimum(behind, ahead))


def _rim_of(vehicle: Vehicle) -> Floats:
    """(2, places) distances from a wheel's lowest point and the rim's height there [m].

    Up to where the rim is higher than any step that the wheel may climb.
    """
    radius = vehicle.wheel_radius
    reach = np.sqrt(radius**2 - max(radius - vehicle.shape.max_step, 0.0) ** 2)
    away = reach * np.arange(1, _RIM_PLACES + 1) / _RIM_PLACES
    return np.array([away, radius - np.sqrt(radius**2 - away**2)])


_wheel_heights: Recent[WheelHeights] = Recent(1)


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
