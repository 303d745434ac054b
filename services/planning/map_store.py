"""The ground as the service knows it: whole maps and patches, put together in the order sent."""

from __future__ import annotations

import hashlib
import json
import threading
import time
import zlib
from collections import OrderedDict
from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError, ParameterError
from slopewise.services.io import height_error, no_data
from slopewise.services.io.map_grid import check_physical
from slopewise.services.wire.counting import Count, MessageOrder
from slopewise.services.wire.messages import MapUpdate
from slopewise.services.wire.notices import Notices
from slopewise.services.wire.sender_clock import SenderClock

_MAX_STD = 10.0
"""Heights that are farther off than that are not measured [m]."""

_OFF_GRID = 1e-3
"""Cells of a patch lie on those of the map, within this share of a cell."""

_MOST_SOURCES = 64
_TOLD_FOR = 60.0
_EARLY = 2.0


@dataclass(frozen=True, slots=True)
class KnownGround:
    """A map in use.

    Attributes:
        elevation_map: ground. version: grows with every change. at: monotonic clock [s].
        incomplete: an update got lost since the last whole map.
        fixed: a map to begin with, and no update came since: its age does not count.
        delay: how much longer than the quickest one its last update was on its way [s].
        notices: sources that count otherwise than they did, or whose clock is not to be believed.
        id: who told of it last, with the number of the update. digest: SHA-256 of the cells; with
            each patch of the digest so far and the cells of the patch.
    """

    elevation_map: ElevationMap
    version: int
    at: float
    incomplete: bool = False
    delay: float = 0.0
    notices: Notices = field(default_factory=Notices)
    id: str = ""
    digest: str = ""
    fixed: bool = False

    def age(self) -> float:
        """Since the ground was seen, as far as clocks here and there can tell [s]."""
        return time.monotonic() - self.at + self.delay

    def flags(self) -> list[str]:
        """What is not as it should be with those who tell of the ground."""
        return self.notices.told()


class _Source:
    """One that sends maps: its count and its clock; whether it was known by another instance."""

    def __init__(self, *, anew: bool) -> None:
        self.anew = anew
        self.count = Count()
        self.clock = SenderClock()


class MapStore:
    """Takes updates from one thread; any thread may read :attr:`ground`.

    Attributes:
        ground: as it is known now; None before the first map.
        restarts: sources that began to count anew.
    """

    def __init__(self, elevation_map: ElevationMap | None = None, name: str = "") -> None:
        """Begin with a map of that name, or with none."""
        self.ground: KnownGround | None = None
        self.restarts = 0
        self._notices = Notices(_TOLD_FOR)
        self._unread: OrderedDict[str, str] = OrderedDict()
        self._sources: OrderedDict[tuple[str, str], _Source] = OrderedDict()
        self._lock = threading.Lock()
        if elevation_map is not None:
            self.ground = KnownGround(
                elevation_map,
                1,
                time.monotonic(),
                notices=self._notices,
                id=name,
                digest=_digest(elevation_map),
                fixed=True,
            )
            self._say_assumed(elevation_map)

    def take(self, update: MapUpdate, source: str, arrived: float | None = None) -> bool:
        """Take up an update; False if it is one that was seen already, or older.

        Args:
            update: whole map or patch.
            source: key it came on, for errors.
            arrived: monotonic clock at its arrival, if that is not now [s].

        Raises:
            InputError: it is no ground, or does not fit; what is known stays as it is.
        """
        at = time.monotonic() if arrived is None else arrived
        content = zlib.crc32(np.ascontiguousarray(update.elevation).data)
        with self._lock:
            one = self._source(update)
            lead = 0.0 if update.time is None else update.time - at
            order = one.count.judge(update.sequence, content, lead)
            backwards = f"maps of {update.source} count backwards: not taken up"
            if not order.taken:
                if order is MessageOrder.OLDER:
                    self._notices.say(backwards)
                return False
            last = one.count.last
            begins = order is not MessageOrder.NEW or (last < 0 and one.anew)
            lost = begins or 0 <= last < update.sequence - 1
            try:
                elevation_map = self._patched(update) if update.patch else _whole(update)
            except ParameterError as error:
                raise InputError(source, error.field, f"expected {error.expected}") from None
            known = self.ground
            incomplete = update.patch and (lost or (known is not None and known.incomplete))
            version = 1 if known is None else known.version + 1
            delay = 0.0 if update.time is None else self._delay(one, update.source, lead)
            before = known.digest if known is not None and update.patch else ""
            self.ground = KnownGround(
                elevation_map,
                version,
                at,
                incomplete,
                delay,
                self._notices,
                _id_of(update),
                _digest(update if update.patch else elevation_map, before),
            )
            if not update.patch:
                self._notices.take_back(self._unread.pop(update.source, ""))
            one.count.take(update.sequence, content)
            self._say_assumed(elevation_map)
            if order is not MessageOrder.NEW:
                self.restarts += 1
                self._notices.take_back(backwards)
                self._notices.say(f"maps of {update.source}: the source {order.value}")
            return True

    def _source(self, update: MapUpdate) -> _Source:
        """Who sent it; of many, those who were heard the longest ago are forgotten."""
        name = update.source, update.instance
        one = self._sources.pop(name, None)
        if one is None:
            one = _Source(anew=any(source == update.source for source, _ in self._sources))
            if one.anew:
                self.restarts += 1
                self._notices.say(f"maps of {update.source}: the source was started anew")
        self._sources[name] = one
        while len(self._sources) > _MOST_SOURCES:
            self._sources.popitem(last=False)
        return one

    def _delay(self, one: _Source, name: str, lead: float) -> float:
        """How long a map with a time stamp was on its way, beyond the quickest [s]."""
        judged = one.clock.judge(lead, _EARLY)
        if judged in ("future", "jumped"):
            self._notices.say(f"the clock of {name} was set")
        return one.clock.delay(lead)

    def _say_assumed(self, elevation_map: ElevationMap) -> None:
        for assumption in elevation_map.assumed:
            self._notices.say(f"map: {assumption}")

    def flags(self) -> list[str]:
        """As :meth:`KnownGround.flags`, also before any ground is known."""
        return self._notices.told()

    def refuse(self, source: str, reason: str) -> None:
        """Flag a map that could not be used: the one before stays, and ages.

        Args:
            source: sender, "" if it cannot be read. reason: one sentence.
        """
        flag = f"a map of {source or 'a sender without a name'} could not be used: {reason[:200]}"
        with self._lock:
            self._notices.take_back(self._unread.pop(source, ""))
            self._notices.say(flag)
            self._unread[source] = flag
            while len(self._unread) > _MOST_SOURCES:
                self._unread.popitem(last=False)

    def lose(self) -> None:
        """Say that an update got lost: what is known may be out of date."""
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
        heights, assumed = _heights(update, known.elevation)
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
        return replace(
            known, elevation=elevation, terrain_class=classes, height_std=std, assumed=assumed
        )


def _id_of(update: MapUpdate) -> str:
    start = f"/{update.instance}" if update.instance else ""
    return f"{update.source}{start}#{update.sequence}"


def _digest(cells: ElevationMap | MapUpdate, before: str = "") -> str:
    """SHA-256 of cells, and of what was known before where they are a patch."""
    names = list(cells.class_names or ())
    head = (
        before,
        cells.elevation.shape,
        cells.resolution,
        list(cells.origin),
        names,
        cells.height_std,
    )
    digest = hashlib.sha256(json.dumps(head).encode())
    digest.update(np.ascontiguousarray(cells.elevation, np.float64).data)
    if cells.terrain_class is not None:
        digest.update(np.ascontiguousarray(cells.terrain_class, np.int64).data)
    return digest.hexdigest()


def _whole(update: MapUpdate) -> ElevationMap:
    classes = None if update.terrain_class is None else _classes(update)
    std = update.height_std
    heights, assumed = _heights(update)
    return ElevationMap(
        elevation=heights,
        resolution=update.resolution,
        origin=update.origin,
        terrain_class=classes,
        class_names=tuple(update.class_names or ("",)),
        height_std=height_error.assumed(update.resolution) if std is None else std,
        assumed=assumed,
    )


def _heights(update: MapUpdate, *around: Floats) -> tuple[Floats, tuple[str, ...]]:
    """Heights, NaN where unknown, and assumptions made of them; `around`: the map they change."""
    heights = update.elevation
    if not (update.height_std or 0.0) <= _MAX_STD:
        expected = f"a number of 0 … {_MAX_STD:g} m, got {update.height_std:g}"
        raise ParameterError("height_std", expected)
    if heights.ndim != 2 or heights.size == 0:
        raise ParameterError("elevation", f"cells (rows, columns), got shape {heights.shape}")
    check_physical(update.resolution, update.origin, heights.shape)
    known, markers = no_data.known_heights(heights, None, around)
    return known, no_data.describe(markers, remedy="")


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
