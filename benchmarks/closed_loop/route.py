"""A route over a terrain, and the station of a vehicle along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from slopewise.models.arrays import Floats
from slopewise.models.vehicle import Vehicle

from .loop_terrain import RESOLUTION, PhysicsGround

LENGTH = 50.0
"""Length of a route in the plan view [m]."""

_STEP = 0.1  # [m] between points
_MARGIN = 3.0  # [m] to the edge of the terrain
_MAX_CURVATURE = 0.11  # [1/m]
MAX_GRADE = np.deg2rad(20.0)
"""Grade of the steepest route that is driven [rad]."""

_MAX_ROLL = np.deg2rad(15.0)  # tyres on grass slide sideways before the vehicle tips
_SEARCH = 8  # points around the last place among which the vehicle is located
_MAX_DRAWS = 80  # of routes on one terrain
_CHOICES = 5  # routes of which the steepest is driven


@dataclass(frozen=True, slots=True)
class Route:
    """Points a tenth of a metre apart, arrays of shape (n,).

    Attributes:
        x, y, heading: pose in the plan view [m], [rad].
        station: along the ground, three-dimensional [m].
        grade, roll: under the wheels, uphill and left side up positive [rad].
    """

    x: Floats
    y: Floats
    heading: Floats
    station: Floats
    grade: Floats
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
        return np.column_stack(
            (np.interp(along, self.station, self.x), np.interp(along, self.station, self.y))
        )


def draw_route(
    terrain: PhysicsGround, rng: np.random.Generator, vehicle: Vehicle, max_grade: float = MAX_GRADE
) -> Route | None:
    """Draw a winding route within the terrain and the grade; None without success."""
    routes: list[Route] = []
    for _ in range(_MAX_DRAWS):
        route = _draw(terrain, rng, vehicle.wheelbase, vehicle.track_width)
        inside = (
            min(route.x.min(), route.y.min()) > _MARGIN
            and max(route.x.max(), route.y.max()) < terrain.size - _MARGIN
        )
        gentle = np.abs(route.grade).max() <= max_grade and np.abs(route.roll).max() <= _MAX_ROLL
        if inside and gentle:
            routes.append(route)
        if len(routes) == _CHOICES:
            break
    return max(routes, key=lambda r: float(np.abs(r.grade).max()), default=None)


def _draw(
    terrain: PhysicsGround, rng: np.random.Generator, wheelbase: float, track_width: float
) -> Route:
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
        heights: Floats = map_coordinates(
            terrain.height, [north / RESOLUTION, east / RESOLUTION], order=1, mode="nearest"
        )
        return heights

    half, side = 0.5 * wheelbase, 0.5 * track_width
    corners = {(a, b): height(a * half, b * side) for a in (1, -1) for b in (1, -1)}
    rise = (corners[1, 1] + corners[1, -1] - corners[-1, 1] - corners[-1, -1]) / (2 * wheelbase)
    tilt = (corners[1, 1] + corners[-1, 1] - corners[1, -1] - corners[-1, -1]) / (2 * track_width)
    grade = np.arctan(rise)
    z = height(0.0, 0.0)
    steps = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2 + np.diff(z) ** 2)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    return Route(x, y, heading, station, grade, np.arctan(tilt * np.cos(grade)))
