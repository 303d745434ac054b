"""What happens on a drive: how far one sees, what appears, what becomes unknown, where.

Drawn once from a seed and fixed to stations, so that every policy meets the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from slopewise.models.arrays import Floats

from .quad import QUAD
from .route import Route
from .terrain import RESOLUTION, PhysicsGround

Kind = Literal["forced", "obstacle", "unknown"]

UNKNOWN_RADIUS = 1.0
"""Of a patch of unknown ground [m]."""

_SPACING = (7.0, 10.0)  # [m] between happenings
_FIRST = 0.0  # [m] before the first
_KINDS: tuple[Kind, ...] = ("forced", "obstacle", "unknown")
_SHARES = (0.8, 0.1, 0.1)
_STRETCH = (5.0, 12.0)  # [m] over which the range of sight stays the same
_SIGHT = (2.0, 7.0)  # [m]
_FOOTPRINT = 1.0  # [m] no wheel is farther from the middle of the wheelbase


@dataclass(slots=True)
class Happening:
    """One thing that bars the way for a while.

    Attributes:
        kind: ``forced``: a wall appears at the end of what is known free, and the brakes are
            slammed on; ``obstacle``: a wall comes into view; ``unknown``: a hole in the map.
        trigger: station of the vehicle at which it happens [m].
        barrier: station that the middle of the wheelbase must not pass [m].
        centre: station of the middle of the hole; NaN without one [m].
        over: it is gone.
    """

    kind: Kind
    trigger: float
    barrier: float
    centre: float = float("nan")
    over: bool = False
    active: bool = field(default=False)


class Course:
    """Sight and happenings along one route."""

    def __init__(
        self,
        route: Route,
        rng: np.random.Generator,
        *,
        only_forced: bool = False,
        sight: tuple[float, float] = _SIGHT,
    ) -> None:
        self._route = route
        self._draw_sight(rng, sight)
        self.happenings = self._draw_happenings(rng, only_forced)

    def _draw_sight(self, rng: np.random.Generator, sight: tuple[float, float]) -> None:
        edges, ranges = [0.0], [rng.uniform(*sight)]
        while edges[-1] < self._route.length:
            edges.append(edges[-1] + rng.uniform(*_STRETCH))
            ranges.append(rng.uniform(*sight))
        station = self._route.station
        reach = station + np.interp(station, edges, ranges)
        # What was once seen to be free stays known.
        self._reach: Floats = np.minimum(np.maximum.accumulate(reach), self._route.length)

    def _draw_happenings(self, rng: np.random.Generator, only_forced: bool) -> list[Happening]:
        found: list[Happening] = []
        at = _FIRST
        while (at := at + rng.uniform(*_SPACING)) < self._route.length - 10.0:
            kind = "forced" if only_forced else str(rng.choice(_KINDS, p=_SHARES))
            if kind == "forced":
                found.append(Happening("forced", at, self.reach(at)))
            elif kind == "obstacle":
                found.append(Happening("obstacle", 0.0, at))
            else:
                found.append(Happening("unknown", 0.0, self._edge_of_hole(at), at))
        standing = [h.barrier for h in found if h.kind != "forced"]
        for h in found:
            if h.kind == "forced":
                later = [b for b in standing if b > h.trigger]
                h.barrier = min([h.barrier, *later])
        return found

    def _edge_of_hole(self, centre: float) -> float:
        """Station at which the first wheel comes to a hole around a station [m]."""
        route = self._route
        near = np.abs(route.station - centre) < UNKNOWN_RADIUS + _FOOTPRINT
        x, y = (route.at(centre, c) for c in (route.x, route.y))
        cos, sin = np.cos(route.heading[near]), np.sin(route.heading[near])
        reached = np.zeros(len(cos), np.bool_)
        for ahead in (0.5 * QUAD.wheelbase, -0.5 * QUAD.wheelbase):
            for aside in (0.5 * QUAD.track_width, -0.5 * QUAD.track_width):
                dx = route.x[near] + ahead * cos - aside * sin - x
                dy = route.y[near] + ahead * sin + aside * cos - y
                reached |= np.hypot(dx, dy) < UNKNOWN_RADIUS
        return float(route.station[near][np.argmax(reached)])

    def reach(self, station: float) -> float:
        """Station up to which the way is seen to be free from a station [m]."""
        return float(np.interp(station, self._route.station, self._reach))

    def told(self, station: float, foresight: bool) -> float:
        """Station up to which a policy is told that no obstacle is in the way [m].

        Args:
            station: where the vehicle is [m].
            foresight: all obstacles to come are known from the start.
        """
        barriers = [
            h.barrier
            for h in self.happenings
            if h.kind != "unknown" and not h.over and (foresight or self._bars(h))
        ]
        return min([self._route.length if foresight else self.reach(station), *barriers])

    @property
    def limit(self) -> float:
        """Station that the vehicle must not pass now, whoever knows of it [m]."""
        barriers = [h.barrier for h in self.happenings if not h.over and self._bars(h)]
        return min([self._route.length, *barriers])

    @property
    def known(self) -> float:
        """Station up to which the ground is known [m]; a map tells the same."""
        holes = [h.barrier for h in self.happenings if h.kind == "unknown" and not h.over]
        return min([self._route.length, *holes])

    @staticmethod
    def _bars(happening: Happening) -> bool:
        return happening.active or happening.kind != "forced"

    def unknown_cells(self, terrain: PhysicsGround) -> np.ndarray | None:
        """Cells of the map that nobody has seen yet, (n, n); None if there are none."""
        holes = [h for h in self.happenings if h.kind == "unknown" and not h.over]
        if not holes:
            return None
        along = RESOLUTION * np.arange(len(terrain.height))
        cells = np.zeros(terrain.height.shape, np.bool_)
        for hole in holes:
            x, y = (self._route.at(hole.centre, c) for c in (self._route.x, self._route.y))
            cells |= np.hypot(along[None, :] - x, along[:, None] - y) < UNKNOWN_RADIUS
        return cells
