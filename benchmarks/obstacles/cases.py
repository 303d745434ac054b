"""Obstacles drawn from a seed: of every kind, around the limits, on slopes, under noise.

They are convex outlines of one height on a plane, with sizes over a vehicle's limits. Nothing of
sizes uses the planner: tyres and body pass over continuous shapes. A map shows outlines to about a
cell, so every case has two sizes: the certain one, if the obstacle were a cell smaller on all
sides, and the possible one, if it were larger.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle

LENGTH = 10.0  # Length of the path in wheelbases; the obstacle is in its middle
_ROCKS = ("rock under a wheel", "rock between the wheels")
KINDS = (*_ROCKS, "log", "step up", "drop", "ditch", "hole", "wall")
RESOLUTIONS = (0.05, 0.08, 0.12, 0.16, 0.20, 0.24)  # [m]
_SMALLEST, _LARGEST = 0.3, 3.0  # sizes over the limits of the vehicle [1]
_NOISE = 0.01  # of the cells over the wheel radius [1]
_MIN_CELLS = 2.5  # of a shape that a map can show
_MAX_GRADE = np.deg2rad(10.0)  # of the plane, along and across


@dataclass(frozen=True, slots=True)
class ObstacleCase:
    """One obstacle in front of one vehicle."""

    kind: str  # kind of obstacle
    vehicle: str  # name of its model
    block: Block  # the obstacle, in the frame of the path
    slope: Slope  # plane under it
    resolution: float  # resolution of the map [m]
    heading: float  # heading of the path on the map [rad]
    seed: int  # determines the noise
    certain: Size  # certain, possible: its sizes, see :func:`size_of`
    possible: Size


def cases(count: int, models: Mapping[str, Model], seed: int) -> Iterator[ObstacleCase]:
    """Yield cases; a seed determines them."""
    rng = np.random.default_rng(seed)
    names, kinds = list(models), KINDS
    for n in range(count):
        name, kind = names[n % len(names)], kinds[(n // len(names)) % len(kinds)]
        vehicle = models[name].vehicle
        # On cells larger than the wheel the planner reports that it cannot resolve steps.
        fine = [r for r in RESOLUTIONS if r <= vehicle.wheel_radius]
        resolution = float(rng.choice(fine))
        block = _draw_block(kind, rng, vehicle, resolution)
        slope = Slope(*(np.tan(rng.uniform(-_MAX_GRADE, _MAX_GRADE, 2)) * (rng.random() < 0.7)))
        heading, seed = float(rng.uniform(-np.pi, np.pi)), int(rng.integers(2**31))
        sizes = _sizes(block, resolution, vehicle)
        yield ObstacleCase(kind, name, block, slope, resolution, heading, seed, *sizes)


def _sizes(block: Block, resolution: float, vehicle: Vehicle) -> tuple[Size, Size]:
    """Certain and possible size: a map shows outlines to about a cell."""
    sizes = [size_of(block.grown(by), vehicle) for by in (-resolution, 0.0, resolution)]
    return Size(*map(min, zip(*sizes, strict=True))), Size(*map(max, zip(*sizes, strict=True)))


def map_of(case: ObstacleCase, vehicle: Vehicle) -> ElevationMap:
    """Map of a case, each cell the median of the heights in it."""
    half = 0.5 * LENGTH * vehicle.wheelbase + 4.0 * vehicle.wheelbase
    cells = int(2.0 * half / case.resolution)
    along = (np.arange(cells) - 0.5 * (cells - 1)) * case.resolution
    inside = case.resolution * np.array([-0.4, 0.0, 0.4])
    c, s = np.cos(case.heading), np.sin(case.heading)
    heights = []
    for dx, dy in product(inside, inside):
        x, y = np.meshgrid(along + dx, along + dy)
        level = case.slope.along * (c * dx + s * dy) + case.slope.across * (c * dy - s * dx)
        heights.append(height_of(case.block, case.slope, c * x + s * y, c * y - s * x) - level)
    std, rng = _NOISE * vehicle.wheel_radius, np.random.default_rng(case.seed)
    elevation = np.median(heights, axis=0) + rng.normal(0.0, std, (cells,) * 2)
    origin = (float(along[0]), float(along[0]))
    return ElevationMap(elevation=elevation, resolution=case.resolution, origin=origin)


def path_of(case: ObstacleCase, vehicle: Vehicle) -> CandidatePath:
    """Straight path over the middle of the map."""
    half = 0.5 * LENGTH * vehicle.wheelbase
    ahead = np.array([np.cos(case.heading), np.sin(case.heading)])
    return CandidatePath(case.kind, np.stack([-half * ahead, half * ahead]))


def _draw_block(kind: str, rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    """Draw an obstacle of a kind, around the limits of the vehicle."""
    step = vehicle.shape.max_step

    def share() -> float:
        return float(np.exp(rng.uniform(np.log(_SMALLEST), np.log(_LARGEST))))

    def half_length() -> float:
        shortest = _MIN_CELLS * resolution
        return 0.5 * float(rng.uniform(shortest, shortest + 2.0 * vehicle.wheel_radius))

    def uniform(size: float) -> float:
        return float(rng.uniform(-size, size))

    match kind:
        case "rock under a wheel":
            side, half = float(rng.choice([-0.5, 0.5])) * vehicle.track_width, half_length()
            y = side + uniform(0.5) * vehicle.shape.wheel_width
            return Block(0.0, y, uniform(0.8), half, half, share() * step)
        case "rock between the wheels":
            half = min(half_length(), 0.3 * vehicle.track_width)
            y = uniform(0.15) * vehicle.track_width
            return Block(0.0, y, uniform(0.8), half, half, share() * vehicle.shape.clearance)
        case "log":
            half, yaw = half_length(), uniform(0.6)
            return Block(0.0, 0.0, yaw, half, FAR, share() * step)
        case "step up" | "drop":
            yaw = uniform(0.6)
            height = (1.0 if kind == "step up" else -1.0) * share() * step
            return Block(FAR * np.cos(yaw), FAR * np.sin(yaw), yaw, FAR, 2.0 * FAR, height)
        case "ditch":
            length = float(rng.uniform(0.3, 7.0)) * vehicle.wheel_radius
            half = 0.5 * max(length, _MIN_CELLS * resolution)
            return Block(0.0, 0.0, uniform(0.5), half, FAR, -share() * step)
        case "hole":
            side = float(rng.choice([-0.5, 0.5])) * vehicle.track_width
            half = max(half_length(), 0.8 * vehicle.shape.wheel_width)
            y = side + uniform(0.3) * half
            return Block(0.0, y, uniform(0.8), half, half, -share() * step)
    sign = float(rng.choice([-1.0, 1.0]))
    near, half = 0.5 * vehicle.shape.width / share(), half_length()
    height = float(rng.uniform(1.5, 4.0)) * vehicle.shape.clearance
    return Block(0.0, sign * (near + half), 0.0, 4.0 * half, half, height)


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
