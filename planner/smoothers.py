"""Smoothers of the candidates that were finished last, each with the stations of its answer."""

from __future__ import annotations

from dataclasses import dataclass

from planner.compiled import Floats
from planner.emission import smoother_size
from planner.smoothing import Smoother

_INSIDE = 2
"""A station of a path that lies ahead of the vehicle for certain."""

_SAME = 1e-3
"""Stations as close as that are the same [m]."""


@dataclass(slots=True)
class Remembering:
    """A smoother, and the stations of the answer that it remembers; None if it has none."""

    smoother: Smoother
    stations: tuple[Floats, Floats] | None = None

    def shift(self, x: Floats, y: Floats) -> int | None:
        """Stations from the answer that it remembers to a path that begins now.

        The same path goes on with the same stations, but for its first one, which is where the
        vehicle is; on another path, or on other stations, an answer is no help.
        """
        before, self.stations = self.stations, (x, y)
        if before is None or len(x) <= _INSIDE:
            return None
        off_x, off_y = before[0] - x[_INSIDE], before[1] - y[_INSIDE]
        off_sq = off_x * off_x + off_y * off_y
        m = int(off_sq.argmin())
        return m - _INSIDE if off_sq[m] < _SAME * _SAME and m >= _INSIDE else None


class Smoothers:
    """One for each of the candidates that were finished last; the others' make room."""

    def __init__(self, most: int) -> None:
        """Keep at most so many."""
        self._most = most
        self._of: dict[str, Remembering] = {}

    def of(self, name: str, stations: int) -> Remembering:
        """The candidate's own smoother, or one that remembers nothing yet."""
        size, known = smoother_size(stations), self._of
        own = known.pop(name, None)
        if own is None or own.smoother.stations != size:
            spare = None
            if len(known) >= self._most:
                # The one that waited longest makes room.
                spare = known.pop(next(iter(known))).smoother
            fits = spare is not None and spare.stations == size
            own = Remembering(spare if spare is not None and fits else Smoother(size))
        known[name] = own
        return own

    def drop(self, name: str) -> None:
        """Not that one any more: it failed."""
        self._of.pop(name, None)
