"""The map in use, assembled from whole maps and patches in the order in which they were sent."""

from __future__ import annotations

import threading
import time
import zlib
from collections import OrderedDict
from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.services.io.files import faults_of
from slopewise.services.wire.arrival import (
    MessageOrder,
    SenderTable,
    SequenceTracker,
    StampCheck,
    StampVerdict,
    time_asleep,
    warn_of_order,
)
from slopewise.services.wire.map_message import apply_update, digest, update_id
from slopewise.services.wire.plan_messages import MapUpdate
from slopewise.services.wire.recent_warnings import RecentWarnings

_MAX_SOURCES = 64  # sources that are remembered [1]; bounds memory

_WARNING_DURATION = 60.0
"""Time for which warnings about maps stay active [s]: some updates of a slow mapper."""

_MAX_EARLY = 2.0  # time by which a source's clock may run ahead of the time that passed [s]


@dataclass(frozen=True, slots=True)
class MapSnapshot:
    """Map in use at one moment."""

    elevation_map: ElevationMap  # terrain
    version: int  # increases with every change
    at: float  # arrival of the last update, monotonic clock [s]
    incomplete: bool = False  # an update was lost since the last whole map
    delay: float = 0.0  # time by which the last update took longer than the quickest one [s]
    # about the count or the clock of sources
    warnings: RecentWarnings = field(default_factory=RecentWarnings)
    id: str = ""  # source and number of the last update
    # SHA-256 of the cells; with each patch, of the digest before it and the cells of the patch
    digest: str = ""
    asleep: float = field(default_factory=time_asleep)  # on its arrival [s]
    fixed: bool = False  # initial map without any update since: its age is ignored

    def age(self) -> float:
        """Time since the terrain was measured, as far as the clocks show [s]."""
        return time.monotonic() - self.at + time_asleep() - self.asleep + self.delay


class _Source:
    """Count and clock of one instance of a source."""

    def __init__(self) -> None:
        self.follows_another = False  # another instance of the source was known before this one
        self.sequence = SequenceTracker()
        self.stamps = StampCheck()


class MapStore:
    """Applies updates from one thread; any thread may read :attr:`snapshot`."""

    def __init__(
        self,
        elevation_map: ElevationMap | None = None,
        name: str = "",
        wheel_radius: float | None = None,
    ) -> None:
        """Begin with a map of that name, or without one.

        With the radius of the wheels [m], maps are averaged for them before they come into use: no
        plan waits for that.
        """
        self._wheel_radius = wheel_radius
        self.snapshot: MapSnapshot | None = None  # map in use; None before the first map
        self.restarts = 0  # number of restarted sources
        self.warnings = RecentWarnings(_WARNING_DURATION)  # also before the first map
        self._rejections: OrderedDict[str, str] = OrderedDict()
        self._sources = SenderTable[tuple[str, str], _Source](_Source, _MAX_SOURCES)
        self._lock = threading.Lock()
        if elevation_map is not None:
            self._average(elevation_map)
            self.snapshot = MapSnapshot(
                elevation_map,
                1,
                time.monotonic(),
                warnings=self.warnings,
                id=name,
                digest=digest(elevation_map),
                fixed=True,
            )
            self._warn_assumed(elevation_map)

    def apply(
        self,
        update: MapUpdate,
        key: str,
        arrived: float | None = None,
        *,
        others_wait: bool = False,
    ) -> bool:
        """Apply an update that came on ``key``; False if it is a duplicate or out of order.

        Where ``others_wait`` the next one is at hand, and this one is averaged only if it is used.
        """
        at = time.monotonic() if arrived is None else arrived
        content = zlib.crc32(np.ascontiguousarray(update.elevation).data)
        lead = 0.0 if update.time is None else update.time - at
        what = f"maps of {update.source}"
        with self._lock:
            source = self._source(update)
            order = source.sequence.classify(update.sequence, content, lead)
            if not order.is_accepted:
                warn_of_order(self.warnings, what, order, is_used=False)
                return False
            last = source.sequence.last
            is_first = last < 0 and source.follows_another
            has_begun = order is not MessageOrder.NEW or is_first
            known = None if self.snapshot is None else self.snapshot.elevation_map
            with faults_of(key):
                elevation_map = apply_update(update, known)
            if not others_wait:
                self._average(elevation_map)
            delay = 0.0 if update.time is None else self._delay(source, update.source, lead)
            is_gap = has_begun or 0 <= last < update.sequence - 1
            self._replace(elevation_map, update, at, delay, is_gap=is_gap)
            source.sequence.accept(update.sequence, content)
            self.restarts += order is not MessageOrder.NEW
            warn_of_order(self.warnings, what, order, is_used=True)
            return True

    def _average(self, elevation_map: ElevationMap) -> None:
        if self._wheel_radius is not None:
            averaged_map(elevation_map, self._wheel_radius)  # cached there

    def _source(self, update: MapUpdate) -> _Source:
        name = update.source, update.instance
        is_known = name in self._sources
        has_other = any(source == update.source for source, _ in self._sources)
        source = self._sources.of(name)
        if has_other and not is_known:
            source.follows_another = True
            self.restarts += 1
            self.warnings.add(f"maps of {update.source}: the source was restarted")
        return source

    def _delay(self, source: _Source, name: str, lead: float) -> float:
        """Time by which a map with a time stamp took longer than the quickest one [s]."""
        verdict = source.stamps.check(lead, _MAX_EARLY)
        if verdict in (StampVerdict.FUTURE, StampVerdict.CLOCK_SET):
            self.warnings.add(f"the clock of {name} was set")
        return source.stamps.delay(lead)

    def _replace(
        self,
        elevation_map: ElevationMap,
        update: MapUpdate,
        at: float,
        delay: float,
        *,
        is_gap: bool,
    ) -> None:
        """Replace the snapshot; ``is_gap``: updates before this one may be missing."""
        known = self.snapshot
        was_incomplete = known is not None and known.incomplete
        before = known.digest if known is not None and update.patch else ""
        self.snapshot = MapSnapshot(
            elevation_map,
            version=1 if known is None else known.version + 1,
            at=at,
            incomplete=update.patch and (is_gap or was_incomplete),
            delay=delay,
            warnings=self.warnings,
            id=update_id(update),
            digest=digest(update if update.patch else elevation_map, before),
        )
        if not update.patch:
            self.warnings.clear(self._rejections.pop(update.source, ""))
        self._warn_assumed(elevation_map)

    def _warn_assumed(self, elevation_map: ElevationMap) -> None:
        for assumption in elevation_map.assumed:
            self.warnings.add(f"map: {assumption}")

    def note_rejection(self, source: str, reason: str) -> None:
        """Warn about a map that could not be used: the one before remains, and ages."""
        text = f"a map of {source or 'a sender without a name'} could not be used: {reason[:200]}"
        with self._lock:
            self.warnings.clear(self._rejections.pop(source, ""))
            self.warnings.add(text)
            self._rejections[source] = text
            while len(self._rejections) > _MAX_SOURCES:
                self._rejections.popitem(last=False)

    def note_loss(self) -> None:
        """Mark the map as incomplete: an update was lost."""
        with self._lock:
            if self.snapshot is not None:
                self.snapshot = replace(self.snapshot, incomplete=True)
