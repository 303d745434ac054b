"""Events of a drive: range of sight, obstacles, unknown ground.

They are drawn once from a seed and fixed to stations, so that every policy meets the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from slopewise.models.arrays import Bools, Floats

from .loop_terrain import RESOLUTION, PhysicsGround
from .quad import WHEEL_PLACES
from .route import Route

Kind = Literal["forced", "obstacle", "unknown"]

UNKNOWN_RADIUS = 1.0
"""Radius of a patch of unknown ground [m]."""

_SPACING = (7.0, 10.0)  # [m] between events
_MIN_REST = 10.0  # [m] of the route after the last event
_KINDS: tuple[Kind, ...] = ("forced", "obstacle", "unknown")
_SHARES = (0.8, 0.1, 0.1)  # of the kinds [1]
_STRETCH = (5.0, 12.0)  # [m] over which the range of sight stays constant
_SIGHT = (2.0, 7.0)  # [m]
_FOOTPRINT = 1.0  # [m]; no wheel is farther from the middle of the wheelbase


@dataclass(slots=True)
class CourseEvent:
    """One event that blocks the route for a while.

    Attributes:
        kind: ``forced``: a wall appears at the end of the clear distance, and full braking is
            commanded; ``obstacle``: a wall comes into view; ``unknown``: a hole in the map.
        trigger: station of the vehicle at which it happens [m].
        barrier: station that the middle of the wheelbase must not pass [m].
        centre: station of the middle of the hole; NaN without one [m].
        over: whether it has ended.
        active: whether a forced wall stands.
    """

    kind: Kind
    trigger: float
    barrier: float
    centre: float = float("nan")
    over: bool = False
    active: bool = field(default=False)

    @property
    def blocks(self) -> bool:
        """Whether it blocks the route now."""
        return not self.over and (self.active or self.kind != "forced")


class Course:
    """Sight and events along one route.

    Attributes:
        events: in order of their stations.
    """

    def __init__(
        self,
        route: Route,
        rng: np.random.Generator,
        *,
        only_forced: bool = False,
        sight: tuple[float, float] = _SIGHT,
    ) -> None:
        self._route = route
        self._sight_end = self._draw_sight(rng, sight)
        self.events = self._draw_events(rng, only_forced)

    def _draw_sight(self, rng: np.random.Generator, sight: tuple[float, float]) -> Floats:
        edges, ranges = [0.0], [rng.uniform(*sight)]
        while edges[-1] < self._route.length:
            edges.append(edges[-1] + rng.uniform(*_STRETCH))
            ranges.append(rng.uniform(*sight))
        station = self._route.station
        end = station + np.interp(station, edges, ranges)
        # Ground once seen to be free stays known.
        clear: Floats = np.minimum(np.maximum.accumulate(end), self._route.length)
        return clear

    def _draw_events(self, rng: np.random.Generator, only_forced: bool) -> list[CourseEvent]:
        events: list[CourseEvent] = []
        station = 0.0
        while (station := station + rng.uniform(*_SPACING)) < self._route.length - _MIN_REST:
            kind = "forced" if only_forced else str(rng.choice(_KINDS, p=_SHARES))
            if kind == "forced":
                events.append(CourseEvent("forced", station, self.sight_end(station)))
            elif kind == "obstacle":
                events.append(CourseEvent("obstacle", 0.0, station))
            else:
                edge = self._edge_of_hole(station)
                events.append(CourseEvent("unknown", 0.0, edge, station))
        barriers = [e.barrier for e in events if e.kind != "forced"]
        for event in events:
            if event.kind == "forced":
                later = [b for b in barriers if b > event.trigger]
                event.barrier = min([event.barrier, *later])
        return events

    def _edge_of_hole(self, centre: float) -> float:
        """Station at which the first wheel reaches a hole around a station [m]."""
        route = self._route
        near = np.abs(route.station - centre) < UNKNOWN_RADIUS + _FOOTPRINT
        x, y = (route.at(centre, c) for c in (route.x, route.y))
        cos, sin = np.cos(route.heading[near]), np.sin(route.heading[near])
        reached = np.zeros(len(cos), np.bool_)
        for x_body, y_body in WHEEL_PLACES:
            dx = route.x[near] + x_body * cos - y_body * sin - x
            dy = route.y[near] + x_body * sin + y_body * cos - y
            reached |= np.hypot(dx, dy) < UNKNOWN_RADIUS
        return float(route.station[near][np.argmax(reached)])

    def sight_end(self, station: float) -> float:
        """Station up to which the route is seen to be free from a station [m]."""
        return float(np.interp(station, self._route.station, self._sight_end))

    def reported_clear(self, station: float, foresight: bool) -> float:
        """Station up to which no obstacle is reported to a policy [m].

        Args:
            station: station of the vehicle [m].
            foresight: whether all obstacles to come are known from the start.
        """
        barriers = [
            e.barrier
            for e in self.events
            if e.kind != "unknown" and not e.over and (foresight or e.blocks)
        ]
        return min([self._route.length if foresight else self.sight_end(station), *barriers])

    @property
    def limit(self) -> float:
        """Station that the vehicle must not pass now [m]."""
        return min([self._route.length, *(e.barrier for e in self.events if e.blocks)])

    @property
    def known(self) -> float:
        """Station up to which the ground is known, as the map shows [m]."""
        return min([self._route.length, *(hole.barrier for hole in self._holes())])

    def _holes(self) -> list[CourseEvent]:
        return [e for e in self.events if e.kind == "unknown" and not e.over]

    def unknown_cells(self, terrain: PhysicsGround) -> Bools | None:
        """Unknown cells of the map, shape (n, n); None without any."""
        holes = self._holes()
        if not holes:
            return None
        along = RESOLUTION * np.arange(len(terrain.height))
        cells = np.zeros(terrain.height.shape, np.bool_)
        for hole in holes:
            x, y = (self._route.at(hole.centre, c) for c in (self._route.x, self._route.y))
            cells |= np.hypot(along[None, :] - x, along[:, None] - y) < UNKNOWN_RADIUS
        return cells
