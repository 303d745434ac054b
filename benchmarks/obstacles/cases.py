"""Obstacles drawn from a seed: of every kind, around the limits, on slopes, under noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle

from .true_sizes import FAR, Block, Size, Slope, height_of, size_of

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
    certain: Size  # certain, possible: its sizes, see :mod:`.true_sizes`
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
