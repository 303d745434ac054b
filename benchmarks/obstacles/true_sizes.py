"""Obstacles as convex outlines of one height on a plane, and their sizes over a vehicle's limits.

Nothing here uses the planner: tyres and body pass over continuous shapes. A map shows outlines to
about a cell, so every case has two sizes: the certain one, if the obstacle were a cell smaller on
all sides, and the possible one, if it were larger.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.vehicle import Vehicle

FAR = 60.0  # Half length of an endless shape [m]


@dataclass(frozen=True, slots=True)
class Block:
    """A turned rectangle of ground that is higher or lower than the plane around it.

    The path runs along x of this frame, through y = 0.
    """

    x: float  # x, y: place of its middle [m]
    y: float
    yaw: float  # direction of its long sides from the path [rad]
    half_length: float  # half_length, half_width: along and across its own x [m]
    half_width: float
    height: float  # above the plane, below it if negative [m]

    def grown(self, by: float) -> Block:
        """Return it wider on all sides, smaller if ``by`` is negative [m]."""
        length, width = max(self.half_length + by, 0.0), max(self.half_width + by, 0.0)
        return replace(self, half_length=length, half_width=width)

    def contains(self, x: Floats, y: Floats) -> Bools:
        """Mask of the points inside."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        along = c * (x - self.x) + s * (y - self.y)
        across = c * (y - self.y) - s * (x - self.x)
        inside = (np.abs(along) <= self.half_length) & (np.abs(across) <= self.half_width)
        return np.asarray(inside)

    @property
    def corners(self) -> Floats:
        """Corners in order around it, shape (4, 2) [m]."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        u = self.half_length * np.array([1.0, -1.0, -1.0, 1.0])
        v = self.half_width * np.array([1.0, 1.0, -1.0, -1.0])
        return np.column_stack([self.x + c * u - s * v, self.y + s * u + c * v])

    def span_between(self, x_min: float, x_max: float) -> tuple[float, float] | None:
        """Smallest and largest y where x is within a range, None outside [m]."""
        points = self.corners
        sides = [p[1] for p in points if x_min <= p[0] <= x_max]
        for first, second in zip(points, np.roll(points, -1, axis=0), strict=True):
            for x in (x_min, x_max):
                if (first[0] - x) * (second[0] - x) < 0.0:
                    share = (x - first[0]) / (second[0] - first[0])
                    sides.append(first[1] + share * (second[1] - first[1]))
        return (float(min(sides)), float(max(sides))) if sides else None


@dataclass(frozen=True, slots=True)
class Slope:
    """Plane under obstacles: rise along the path and to its left [1]."""

    along: float
    across: float


def height_of(block: Block, slope: Slope, x: Floats, y: Floats) -> Floats:
    """Height of the ground at points of the path's frame [m]."""
    raised: Floats = np.where(block.contains(x, y), block.height, 0.0)
    return slope.along * x + slope.across * y + raised


_GRAIN = 0.004  # [m] between samples along the path of a wheel
_ACROSS = 9  # samples over the width of a tyre
_GRAZE = 0.1  # of the width of a tyre, which needs no climb [1]
_EXTENT = 3.0  # [m] of the path before and after the obstacle


class Size(NamedTuple):
    """Sizes over the limits that apply; 1 is at the limit."""

    step: float  # height that a wheel has to climb or drop
    underside: float  # height between the wheels, over the ground clearance
    articulation: float  # height of one wheel from the plane of the other three
    # half the width of the vehicle over the distance of an obstacle at its side, or its height over
    # the ground clearance: the smaller one, as both make it too large
    lateral: float

    @property
    def largest(self) -> float:
        """The governing size."""
        return max(self)


def size_of(block: Block, vehicle: Vehicle) -> Size:
    """Sizes of an obstacle for a vehicle that drives along x, its middle on y = 0."""
    shape = vehicle.shape
    span = block.span_between(-_EXTENT, _EXTENT)
    if span is None or min(block.half_length, block.half_width) <= 0.0:
        return Size(0.0, 0.0, 0.0, 0.0)
    half_track, half_tyre = 0.5 * vehicle.track_width, 0.5 * shape.wheel_width
    step, graze = 0.0, _GRAZE * shape.wheel_width
    for side in (half_track, -half_track):
        inner, outer = side - half_tyre, side + half_tyre
        # A corner that only grazes the side of the tyre needs no climb.
        if span[1] <= inner + graze or span[0] >= outer - graze:
            continue
        climb = block.height if block.height > 0.0 else -_wheel_path(block, vehicle, side).min()
        step = max(step, float(climb) / shape.max_step)
    articulation = _articulation(block, vehicle) / shape.wheel_travel
    if block.height <= 0.0:
        return Size(step, 0.0, articulation, 0.0)
    between = half_track - half_tyre
    under = span[0] < between and span[1] > -between
    underside = block.height / shape.clearance if under else 0.0
    near = 0.0 if span[0] <= 0.0 <= span[1] else min(abs(span[0]), abs(span[1]))
    lateral = 0.0
    if block.height > shape.clearance:
        lateral = min(0.5 * shape.width / max(near, 0.05), block.height / shape.clearance)
    return Size(step, underside, articulation, lateral)


def _articulation(block: Block, vehicle: Vehicle) -> float:
    """Largest height of one wheel from the plane of the other three [m].

    0 for obstacles that no wheel can climb, so that none stands on them.
    """
    if abs(block.height) > 2.0 * vehicle.shape.max_step:
        return 0.0
    left, right = (_wheel_path(block, vehicle, s * 0.5 * vehicle.track_width) for s in (1, -1))
    axles = round(vehicle.wheelbase / _GRAIN)
    height = (left - right)[axles:] - (left - right)[:-axles]
    return float(np.abs(height).max())


def _wheel_path(block: Block, vehicle: Vehicle, side: float) -> Floats:
    """Height of the lowest point of a wheel above the plane along its path [m]."""
    radius, half_tyre = vehicle.wheel_radius, 0.5 * vehicle.shape.wheel_width
    x = np.arange(-_EXTENT, _EXTENT, _GRAIN)
    highest = np.full(len(x), -np.inf)
    for across in np.linspace(side - half_tyre, side + half_tyre, _ACROSS):
        below = block.contains(x, np.full(len(x), across))
        highest = np.maximum(highest, np.where(below, block.height, 0.0))
    lowest = highest.copy()
    for n in range(1, int(radius / _GRAIN)):
        rim = radius - np.sqrt(radius**2 - (n * _GRAIN) ** 2)
        lowest[n:] = np.maximum(lowest[n:], highest[:-n] - rim)
        lowest[:-n] = np.maximum(lowest[:-n], highest[n:] - rim)
    return lowest
