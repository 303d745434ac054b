"""Route of a drive, and its events: range of sight, obstacles, unknown ground.

Events are drawn once from a seed and fixed to stations, so that every policy meets the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from slopewise.models.arrays import Bools, Floats

from .loop_terrain import RESOLUTION, PhysicsGround
from .quad import QUAD, WHEEL_PLACES

LENGTH = 50.0  # Length of a route in the plan view [m]
_STEP = 0.1  # [m] between points
_MARGIN = 3.0  # [m] to the edge of the terrain
_MAX_CURVATURE = 0.11  # [1/m]
MAX_GRADE = np.deg2rad(20.0)  # Grade of the steepest route that is driven [rad]
_MAX_ROLL = np.deg2rad(15.0)  # tyres on grass slide sideways before the vehicle tips
_SEARCH = 8  # points around the last place among which the vehicle is located
_MAX_DRAWS = 80  # of routes on one terrain
_CHOICES = 5  # routes of which the steepest is driven


@dataclass(frozen=True, slots=True)
class Route:
    """Points a tenth of a metre apart, arrays of shape (n,)."""

    x: Floats  # x, y, heading: pose in the plan view [m], [rad]
    y: Floats
    heading: Floats
    station: Floats  # along the ground, three-dimensional [m]
    grade: Floats  # grade, roll: under the wheels, uphill and left side up positive [rad]
    roll: Floats

    @property
    def length(self) -> float:
        """Length along the ground [m]."""
        return float(self.station[-1])

    def locate(self, x: float, y: float, near: int) -> tuple[int, float]:
        """Index of the nearest point around another one, and the station of the vehicle [m]."""
        first = max(near - _SEARCH, 0)
        part = slice(first, near + _SEARCH)
        i = first + int(np.argmin((self.x[part] - x) ** 2 + (self.y[part] - y) ** 2))
        heading = float(self.heading[i])
        along = (x - self.x[i]) * math.cos(heading) + (y - self.y[i]) * math.sin(heading)
        return i, float(self.station[i] + along / math.cos(self.grade[i]))

    def at(self, station: float, values: Floats) -> float:
        """Value of a column at a station."""
        return float(np.interp(station, self.station, values))

    def points(self, station: float, length: float, spacing: float = 0.5) -> Floats:
        """Points of the route ahead of a station, shape (k, 2) [m]."""
        end = min(station + length, self.length)
        along = np.linspace(station, end, max(int((end - station) / spacing), 3) + 1)
        return np.column_stack([np.interp(along, self.station, c) for c in (self.x, self.y)])


def draw_route(terrain: PhysicsGround, rng: np.random.Generator) -> Route | None:
    """Draw a winding route within the terrain and the grade; None without success."""
    routes: list[Route] = []
    for _ in range(_MAX_DRAWS):
        route = _draw(terrain, rng)
        inside = min(route.x.min(), route.y.min()) > _MARGIN
        inside &= max(route.x.max(), route.y.max()) < terrain.size - _MARGIN
        gentle = np.abs(route.grade).max() <= MAX_GRADE and np.abs(route.roll).max() <= _MAX_ROLL
        if inside and gentle:
            routes.append(route)
        if len(routes) == _CHOICES:
            break
    return max(routes, key=lambda r: float(np.abs(r.grade).max()), default=None)


def _draw(terrain: PhysicsGround, rng: np.random.Generator) -> Route:
    along = np.arange(0.0, LENGTH, _STEP)
    wave = rng.uniform(18.0, 45.0)
    swing = rng.uniform(0.0, _MAX_CURVATURE) * wave / (2.0 * np.pi)
    direction = rng.uniform(0.0, 2.0 * np.pi)
    heading = direction + swing * np.sin(2.0 * np.pi * along / wave + rng.uniform(0.0, 6.28))
    x, y = np.cumsum(np.cos(heading)) * _STEP, np.cumsum(np.sin(heading)) * _STEP
    middle = 0.5 * terrain.size + rng.uniform(-4.0, 4.0, 2)
    x += middle[0] - 0.5 * (x[0] + x[-1])
    y += middle[1] - 0.5 * (y[0] + y[-1])

    def height(x_body: float, y_body: float) -> Floats:
        east = x + x_body * np.cos(heading) - y_body * np.sin(heading)
        north = y + x_body * np.sin(heading) + y_body * np.cos(heading)
        cells = [north / RESOLUTION, east / RESOLUTION]
        return np.asarray(map_coordinates(terrain.height, cells, order=1, mode="nearest"))

    fl, fr, rl, rr = (height(*place) for place in WHEEL_PLACES)
    rise = (fl + fr - rl - rr) / (2 * QUAD.wheelbase)
    tilt = (fl + rl - fr - rr) / (2 * QUAD.track_width)
    grade = np.arctan(rise)
    z = height(0.0, 0.0)
    steps = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2 + np.diff(z) ** 2)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    return Route(x, y, heading, station, grade, np.arctan(tilt * np.cos(grade)))


UNKNOWN_RADIUS = 1.0  # Radius of a patch of unknown ground [m]
_SPACING = (7.0, 10.0)  # [m] between events
_MIN_REST = 10.0  # [m] of the route after the last event
_KINDS = ("forced", "obstacle", "unknown")
_SHARES = (0.8, 0.1, 0.1)  # of the kinds [1]
_STRETCH = (5.0, 12.0)  # [m] over which the range of sight stays constant
_SIGHT = (2.0, 7.0)  # [m]
_FOOTPRINT = 1.0  # [m]; no wheel is farther from the middle of the wheelbase


@dataclass(slots=True)
class CourseEvent:
    """One event that blocks the route for a while."""

    # ``forced``: a wall appears at the end of the clear distance, and full braking is commanded;
    # ``obstacle``: a wall comes into view; ``unknown``: a hole in the map
    kind: str
    trigger: float  # station of the vehicle at which it happens [m]
    barrier: float  # station that the middle of the wheelbase must not pass [m]
    centre: float = float("nan")  # station of the middle of the hole; NaN without one [m]
    over: bool = False  # whether it has ended
    active: bool = False  # whether a forced wall stands

    @property
    def blocks(self) -> bool:
        """Whether it blocks the route now."""
        return not self.over and (self.active or self.kind != "forced")


class Course:
    """Sight and events along one route."""

    def __init__(self, route: Route, rng: np.random.Generator) -> None:
        self._route = route
        self._sight_end = self._draw_sight(rng)
        self.events = self._draw_events(rng)  # in order of their stations

    def _draw_sight(self, rng: np.random.Generator) -> Floats:
        edges, ranges = [0.0], [rng.uniform(*_SIGHT)]
        while edges[-1] < self._route.length:
            edges.append(edges[-1] + rng.uniform(*_STRETCH))
            ranges.append(rng.uniform(*_SIGHT))
        station = self._route.station
        end = station + np.interp(station, edges, ranges)
        # Ground once seen to be free stays known.
        return np.asarray(np.minimum(np.maximum.accumulate(end), self._route.length))

    def _draw_events(self, rng: np.random.Generator) -> list[CourseEvent]:
        events: list[CourseEvent] = []
        station = 0.0
        while (station := station + rng.uniform(*_SPACING)) < self._route.length - _MIN_REST:
            kind = str(rng.choice(_KINDS, p=_SHARES))
            if kind == "forced":
                events.append(CourseEvent("forced", station, self.sight_end(station)))
            elif kind == "obstacle":
                events.append(CourseEvent("obstacle", 0.0, station))
            else:
                events.append(CourseEvent("unknown", 0.0, self._edge_of_hole(station), station))
        barriers = [e.barrier for e in events if e.kind != "forced"]
        for event in (e for e in events if e.kind == "forced"):
            event.barrier = min([event.barrier, *(b for b in barriers if b > event.trigger)])
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
        """Station up to which no obstacle is reported to a policy at a station [m].

        With foresight all obstacles to come are known from the start.
        """
        walls = [e for e in self.events if e.kind != "unknown" and not e.over]
        barriers = [e.barrier for e in walls if foresight or e.blocks]
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

    def unknown_cells(self, terrain: PhysicsGround) -> Bools:
        """Unknown cells of the map, shape (n, n)."""
        along = RESOLUTION * np.arange(len(terrain.height))
        cells = np.zeros(terrain.height.shape, np.bool_)
        for hole in self._holes():
            x, y = (self._route.at(hole.centre, c) for c in (self._route.x, self._route.y))
            cells |= np.hypot(along[None, :] - x, along[:, None] - y) < UNKNOWN_RADIUS
        return cells
