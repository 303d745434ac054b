"""Ground as the guard sees it: the first map, heights and surfaces at points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.averaging_windows import disc_radius
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import averaged_noise
from slopewise.models.recent import Recent
from slopewise.services.io import npz_map
from slopewise.services.io.files import faults_of

_PAIRS = 10
"""Pairs of places on a tyre [1]: a fifth of the noise of cells is left, as of a disc of 25."""

_GOLDEN_ANGLE = 2.399963
"""Angle between neighbours that spreads points evenly over a disc [rad]."""


def read_guard_map(path: Path) -> ElevationMap:
    """Map in an .npz file."""
    info, cells = npz_map.read_info(path), slice(None)
    layers = npz_map.read_layers(path, cells, cells, None, None)
    with faults_of(path):
        return layers.on(info)


def heights_at(ground: ElevationMap, x: Floats, y: Floats) -> Floats:
    """Bilinear heights at points of any shape [m]; NaN at unknown cells and off the map."""
    rows, columns = ground.elevation.shape
    u, v = (x - ground.origin[0]) / ground.resolution, (y - ground.origin[1]) / ground.resolution
    inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    i = np.minimum(v.astype(np.int64), rows - 2)
    j = np.minimum(u.astype(np.int64), columns - 2)
    p, q = u - j, v - i
    flat, first = ground.elevation.ravel(), i * columns + j
    low = (1.0 - p) * flat[first] + p * flat[first + 1]
    high = (1.0 - p) * flat[first + columns] + p * flat[first + columns + 1]
    return np.where(inside, (1.0 - q) * low + q * high, np.nan)


class WheelHeights:
    """Heights as wheels feel them: means over a tyre where heights of a map have an error.

    Pairs of places on opposite sides of a point count if both are known, so that a slope cancels.
    """

    def __init__(self, ground: ElevationMap, wheel_radius: float) -> None:
        """Of one map, for wheels of one radius [m]."""
        self._ground = ground
        self._pairs = np.empty((2, 0))
        if averaged_noise(ground, wheel_radius) > 0.0:
            radius = disc_radius(ground.resolution, wheel_radius, ground.correlation_length)
            n = np.arange(1, _PAIRS + 1)
            away, angle = radius * np.sqrt(n / _PAIRS), _GOLDEN_ANGLE * n
            self._pairs = np.array([away * np.cos(angle), away * np.sin(angle)])

    def at(self, x: Floats, y: Floats) -> Floats:
        """Heights at points of any shape [m]; NaN at unknown cells and off the map."""
        total = heights_at(self._ground, x, y)
        count = np.ones_like(total)
        for east, north in self._pairs.T:
            pair = heights_at(self._ground, x + east, y + north)
            pair = pair + heights_at(self._ground, x - east, y - north)
            known = np.isfinite(pair)
            total = total + np.where(known, pair, 0.0)
            count = count + 2.0 * known
        return total / count


_wheel_heights: Recent[WheelHeights] = Recent(1)


def wheel_heights(ground: ElevationMap, wheel_radius: float) -> WheelHeights:
    """Heights as wheels of one radius feel them [m], the same object for the same map."""
    return _wheel_heights.get(lambda: WheelHeights(ground, wheel_radius), ground, wheel_radius)


def classes_at(ground: ElevationMap, x: Floats, y: Floats) -> Ints:
    """Indices into ``class_names`` at points; off the map those of the nearest cell."""
    if ground.terrain_class is None:
        return np.zeros(np.shape(x), np.int64)
    rows, columns = ground.elevation.shape
    j = np.clip(np.rint((x - ground.origin[0]) / ground.resolution), 0, columns - 1)
    i = np.clip(np.rint((y - ground.origin[1]) / ground.resolution), 0, rows - 1)
    indices: Ints = ground.terrain_class[i.astype(np.int64), j.astype(np.int64)]
    return indices
