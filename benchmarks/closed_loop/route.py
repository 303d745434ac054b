"""A route over a terrain, and where a vehicle is along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from slopewise.models.arrays import Floats
from slopewise.models.vehicle import Vehicle

from .terrain import RESOLUTION, PhysicsGround

LENGTH = 50.0
"""Of a route in the plan view [m]."""

_STEP = 0.1  # [m] between points
_MARGIN = 3.0  # [m] to the edge of the terrain
_SHARPEST = 0.11  # [1/m]
STEEPEST = np.deg2rad(20.0)
"""Grade of the steepest route that is driven [rad]."""

_LEANEST = np.deg2rad(15.0)  # roll; tyres on grass slide sideways before the vehicle tips
_SEARCH = 8  # points around the last place in which the vehicle is looked for
_TRIES = 80
_CHOICES = 5  # routes of which the steepest is driven


@dataclass(frozen=True, slots=True)
class Route:
    """Points a tenth of a metre apart; arrays are (n,).

    Attributes:
        x, y: [m]. heading: [rad]. station: along the ground, three-dimensional [m].
        grade, roll: of the ground under the wheels, uphill and left side up positive [rad].
    """

    x: Floats
    y: Floats
    heading: Floats
    station: Floats
    grade: Floats
    roll: Floats

    @property
    def length(self) -> float:
        """Along the ground [m]."""
        return float(self.station[-1])

    def locate(self, x: float, y: float, near: int) -> tuple[int, float]:
        """Index of the nearest point around another one, and the station beside the vehicle [m]."""
        first = max(near - _SEARCH, 0)
        part = slice(first, near + _SEARCH)
        i = first + int(np.argmin((self.x[part] - x) ** 2 + (self.y[part] - y) ** 2))
        heading = float(self.heading[i])
        along = (x - self.x[i]) * math.cos(heading) + (y - self.y[i]) * math.sin(heading)
        return i, float(self.station[i] + along / math.cos(self.grade[i]))

    def at(self, station: float, values: Floats) -> float:
        """A column at a station."""
        return float(np.interp(station, self.station, values))

    def points(self, station: float, length: float, spacing: float = 0.5) -> Floats:
        """The route ahead of a station, (k, 2)."""
        end = min(station + length, self.length)
        along = np.linspace(station, end, max(int((end - station) / spacing), 3) + 1)
        return np.column_stack(
            (np.interp(along, self.station, self.x), np.interp(along, self.station, self.y))
        )


def draw_route(
    terrain: PhysicsGround, rng: np.random.Generator, vehicle: Vehicle, steepest: float = STEEPEST
) -> Route | None:
    """A winding route within the terrain, nowhere steeper; None where none was found."""
    found: list[Route] = []
    for _ in range(_TRIES):
        route = _draw(terrain, rng, vehicle.wheelbase, vehicle.track_width)
        inside = (
            min(route.x.min(), route.y.min()) > _MARGIN
            and max(route.x.max(), route.y.max()) < terrain.size - _MARGIN
        )
        gentle = np.abs(route.grade).max() <= steepest and np.abs(route.roll).max() <= _LEANEST
        if inside and gentle:
            found.append(route)
        if len(found) == _CHOICES:
            break
    return max(found, key=lambda r: float(np.abs(r.grade).max()), default=None)


def _draw(
    terrain: PhysicsGround, rng: np.random.Generator, wheelbase: float, track_width: float
) -> Route:
    along = np.arange(0.0, LENGTH, _STEP)
    wave = rng.uniform(18.0, 45.0)
    swing = rng.uniform(0.0, _SHARPEST) * wave / (2.0 * np.pi)
    towards = rng.uniform(0.0, 2.0 * np.pi)
    heading = towards + swing * np.sin(2.0 * np.pi * along / wave + rng.uniform(0.0, 6.28))
    x, y = np.cumsum(np.cos(heading)) * _STEP, np.cumsum(np.sin(heading)) * _STEP
    middle = 0.5 * terrain.size + rng.uniform(-4.0, 4.0, 2)
    x += middle[0] - 0.5 * (x[0] + x[-1])
    y += middle[1] - 0.5 * (y[0] + y[-1])

    def height(ahead: float, aside: float) -> Floats:
        east = x + ahead * np.cos(heading) - aside * np.sin(heading)
        north = y + ahead * np.sin(heading) + aside * np.cos(heading)
        found: Floats = map_coordinates(
            terrain.height, [north / RESOLUTION, east / RESOLUTION], order=1, mode="nearest"
        )
        return found

    half, side = 0.5 * wheelbase, 0.5 * track_width
    corners = {(a, b): height(a * half, b * side) for a in (1, -1) for b in (1, -1)}
    rise = (corners[1, 1] + corners[1, -1] - corners[-1, 1] - corners[-1, -1]) / (2 * wheelbase)
    lean = (corners[1, 1] + corners[-1, 1] - corners[1, -1] - corners[-1, -1]) / (2 * track_width)
    grade = np.arctan(rise)
    z = height(0.0, 0.0)
    steps = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2 + np.diff(z) ** 2)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    return Route(x, y, heading, station, grade, np.arctan(lean * np.cos(grade)))
