"""Ground, noise, paths and obstacles, all drawn from a generator."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle

from ..obstacles.true_sizes import FAR, Block, Slope, height_of

Random = np.random.Generator
GROUNDS = ("flat", "swell", "rolling")
SIZED = ("step", "drop", "ditch", "log", "rock", "hole", "post")
KINDS = (*SIZED, "cliff", "edge")  # those without a size are always far above the limits


def noise(shape: tuple[int, ...], cell: float, std: float, length: float, rng: Random) -> Floats:
    """Errors of cells [m], correlated over a length if it is not 0."""
    errors: Floats = rng.standard_normal(shape)
    if length > 0.0:  # Two such kernels in a row have the correlation of the map's definition.
        errors = ndimage.gaussian_filter(errors, length / cell / np.sqrt(2.0), mode="wrap")
        errors /= errors.std()
    return std * errors


def long_ground(kind: str, cell: float, rng: Random) -> ElevationMap:
    """Exact map for paths of 40 m."""
    x, y = np.meshgrid(np.arange(-6.0, 46.0, cell), np.arange(-8.0, 8.0, cell))
    z = _relief(kind, x, y, rng)
    return ElevationMap(elevation=z, resolution=cell, origin=(-6.0, -8.0))


def _relief(kind: str, x: Floats, y: Floats, rng: Random) -> Floats:
    z: Floats = np.zeros_like(x)
    if kind == "swell":
        z = 0.125 * np.sin(2.0 * np.pi * x / 25.0 + rng.uniform(0.0, 6.0)) * np.cos(y / 5.0)
    for _ in range(6 if kind == "rolling" else 0):
        heading, wave = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(14.0, 30.0)
        phase = 2.0 * np.pi * (x * np.cos(heading) + y * np.sin(heading)) / wave
        z = z + rng.uniform(0.1, 0.25) * wave / 25.0 * np.sin(phase + rng.uniform(0.0, 6.0))
    return z


def long_path(number: int, rng: Random) -> CandidatePath:
    """Path of 40 m: a straight line, an arc, a slalom in turn."""
    x = np.linspace(0.0, 40.0, 81)
    arc = rng.uniform(-2.0, 2.0) * (x / 40.0) ** 2
    slalom = rng.uniform(0.3, 1.2) * np.sin(2.0 * np.pi * x / rng.uniform(18.0, 35.0))
    y = rng.uniform(-2.0, 2.0) + (0.0 * x, arc, slalom)[number % 3]
    return CandidatePath(f"{number}", np.stack([x, y], axis=1))


def obstacle_map(
    kind: str, height: float, cell: float, vehicle: Vehicle, rng: Random
) -> tuple[ElevationMap, CandidatePath]:
    """Exact map with an obstacle in its middle, and a path over it, turned and shifted."""
    heading, slope = rng.uniform(-np.pi, np.pi), Slope(*rng.uniform(-0.08, 0.08, 2))
    c, s = np.cos(heading), np.sin(heading)
    along = np.arange(-8.0, 8.0, cell) + rng.uniform(0.0, cell)
    east, north = np.meshgrid(along, along + rng.uniform(0.0, cell))
    x, y = c * east + s * north, c * north - s * east
    block = _block(kind, height, cell, vehicle, rng)
    z = height_of(block, slope, x, y) + _relief("swell", x, y, rng)
    if kind == "post":
        z[np.unravel_index(np.hypot(x - block.x, y - block.y).argmin(), z.shape)] += height
    if kind == "edge":
        z[block.contains(x, y)] = np.nan
    ground = ElevationMap(elevation=z, resolution=cell, origin=(east[0, 0], north[0, 0]))
    return ground, CandidatePath(kind, np.array([[-5.0], [4.0]]) * [c, s])


def _block(kind: str, height: float, cell: float, vehicle: Vehicle, rng: Random) -> Block:
    yaw, turn, radius = rng.uniform(-0.5, 0.5), rng.uniform(-np.pi, np.pi), vehicle.wheel_radius
    wheel = 0.5 * vehicle.track_width + rng.uniform(-0.3, 0.3) * vehicle.shape.wheel_width
    hole, log = max(0.2, radius), 0.5 * max(radius, 0.2, 2.0 * cell)
    blocks = {
        "post": Block(0.0, wheel, 0.0, 0.0, 0.0, 0.0),
        "rock": Block(0.0, wheel, turn, 0.15, 0.15, height),
        "hole": Block(0.0, wheel, turn, hole, hole, -height),
        "ditch": Block(0.0, 0.0, yaw, hole, FAR, -height),  # Tyres bridge shorter ones.
        "log": Block(0.0, 0.0, yaw, log, FAR, height),
    }
    rise = {"step": height, "drop": -height, "cliff": -1.0}.get(kind, 0.0)
    beyond = Block(FAR * np.cos(yaw), FAR * np.sin(yaw), yaw, FAR, 2.0 * FAR, rise)
    return blocks.get(kind, beyond)
