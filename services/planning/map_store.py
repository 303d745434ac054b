"""The ground as the service knows it: whole maps and patches, put together in the order sent."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import Floats
from models.errors import InputError, ParameterError
from planner.ground.elevation_map import ElevationMap
from services.io.maps import height_error
from services.wire.messages import MapUpdate

_HIGHEST = 1e5
"""Beyond that a height is a marker for missing data that nobody declared [m]."""

_OFF_GRID = 1e-3
"""Cells of a patch lie on those of the map, within this share of a cell."""

_MOST_SOURCES = 64


@dataclass(frozen=True, slots=True)
class KnownGround:
    """A map in use.

    Attributes:
        elevation_map: ground. version: grows with every change. at: monotonic clock [s].
        incomplete: an update got lost since the last whole map.
    """

    elevation_map: ElevationMap
    version: int
    at: float
    incomplete: bool = False

    def age(self) -> float:
        """Since the last update [s]."""
        return time.monotonic() - self.at


class MapStore:
    """Takes updates from one thread; any thread may read :attr:`ground`."""

    def __init__(self, elevation_map: ElevationMap | None = None) -> None:
        """Begin with a map, or with none."""
        self.ground: KnownGround | None = None
        self._last: dict[str, int] = {}
        self._lock = threading.Lock()
        if elevation_map is not None:
            self.ground = KnownGround(elevation_map, 1, time.monotonic())

    def take(self, update: MapUpdate, source: str) -> bool:
        """Take up an update; False if it is one that was seen already, or older.

        Args:
            update: whole map or patch.
            source: key it came on, for errors.

        Raises:
            InputError: it is no ground, or does not fit; what is known stays as it is.
        """
        with self._lock:
            last = self._last.get(update.source)
            # A sender that begins to count anew has to call itself anew.
            if last is not None and update.sequence <= last:
                return False
            lost = last is not None and update.sequence > last + 1
            try:
                elevation_map = self._patched(update) if update.patch else _whole(update)
            except ParameterError as error:
                raise InputError(source, error.field, f"expected {error.expected}") from None
            known = self.ground
            incomplete = update.patch and (lost or (known is not None and known.incomplete))
            version = 1 if known is None else known.version + 1
            self.ground = KnownGround(elevation_map, version, time.monotonic(), incomplete)
            self._last[update.source] = update.sequence
            while len(self._last) > _MOST_SOURCES:
                self._last.pop(next(iter(self._last)))
            return True

    def lose(self) -> None:
        """Say that an update could not be read: what is known may be out of date."""
        with self._lock:
            if self.ground is not None:
                self.ground = replace(self.ground, incomplete=True)

    def _patched(self, update: MapUpdate) -> ElevationMap:
        if self.ground is None:
            raise ParameterError("patch", "a whole map first, there is none yet")
        known = self.ground.elevation_map
        if abs(update.resolution - known.resolution) > 1e-6 * known.resolution:
            words = f"{known.resolution:g} m as the whole map, got {update.resolution:g}"
            raise ParameterError("resolution", words)
        heights = _heights(update)
        offset = (np.array(update.origin) - known.origin) / known.resolution
        if not np.all(np.abs(offset - np.round(offset)) <= _OFF_GRID):
            raise ParameterError("origin", f"a cell of the whole map, got {update.origin}")
        column, row = (int(n) for n in np.round(offset))
        rows, columns = known.elevation.shape
        if min(row, column) < 0 or row + len(heights) > rows or column + heights.shape[1] > columns:
            words = f"cells within the {rows} x {columns} of the whole map"
            raise ParameterError("patch", f"{words}, got row {row}, column {column} on")
        cells = slice(row, row + heights.shape[0]), slice(column, column + heights.shape[1])
        elevation = known.elevation.copy()
        elevation[cells] = heights
        classes = known.terrain_class
        if update.terrain_class is not None:
            if update.class_names is not None and tuple(update.class_names) != known.class_names:
                raise ParameterError("class_names", "those of the whole map")
            classes = np.zeros(elevation.shape, np.int64) if classes is None else classes.copy()
            classes[cells] = _classes(update)
        std = max(known.height_std, update.height_std or 0.0)
        return replace(known, elevation=elevation, terrain_class=classes, height_std=std)


def _whole(update: MapUpdate) -> ElevationMap:
    classes = None if update.terrain_class is None else _classes(update)
    std = update.height_std
    return ElevationMap(
        elevation=_heights(update),
        resolution=update.resolution,
        origin=update.origin,
        terrain_class=classes,
        class_names=tuple(update.class_names or ("",)),
        height_std=height_error.assumed(update.resolution) if std is None else std,
    )


def _heights(update: MapUpdate) -> Floats:
    heights = update.elevation
    if heights.ndim != 2 or heights.size == 0:
        raise ParameterError("elevation", f"cells (rows, columns), got shape {heights.shape}")
    return np.where(np.abs(heights) <= _HIGHEST, heights, np.nan)


def _classes(update: MapUpdate) -> np.ndarray:
    classes = update.terrain_class
    assert classes is not None
    if classes.shape != update.elevation.shape:
        words = f"the shape of elevation {update.elevation.shape}, got {classes.shape}"
        raise ParameterError("terrain_class", words)
    most = len(update.class_names or ("",)) if not update.patch else 1 << 20
    if not np.all((classes >= 0) & (classes < most) & (classes == np.round(classes))):
        raise ParameterError("terrain_class", f"whole numbers 0 … {most - 1}")
    return classes.astype(np.int64)
