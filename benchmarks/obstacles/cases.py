"""Obstacles drawn from a seed: of every kind, around the limits, on slopes, under noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle

from .shapes import FAR, Block, Slope, height_of
from .truth import Size, size_of

LENGTH = 10.0
"""Of the path, in vehicle lengths; the obstacle is in its middle."""

RESOLUTIONS = (0.05, 0.08, 0.12, 0.16, 0.20, 0.24)
_SMALLEST, _LARGEST = 0.3, 3.0
_NOISE = 0.01  # of the wheel radius
_FEWEST_CELLS = 2.5
_STEEPEST = np.deg2rad(10.0)


@dataclass(frozen=True, slots=True)
class Case:
    """One obstacle in front of one vehicle.

    Attributes:
        kind: of obstacle. vehicle: name of its model.
        block: the obstacle, in the frame of the path. slope: that it stands on.
        resolution: of the map [m]. heading: of the path on the map [rad]. seed: of the noise.
        sure, possible: its sizes, see :mod:`.truth`.
    """

    kind: str
    vehicle: str
    block: Block
    slope: Slope
    resolution: float
    heading: float
    seed: int
    sure: Size
    possible: Size


def cases(wanted: int, models: Mapping[str, Model], seed: int) -> Iterator[Case]:
    """So many cases; the same ones for the same seed."""
    rng = np.random.default_rng(seed)
    names, kinds = list(models), list(_KINDS)
    for n in range(wanted):
        name, kind = names[n % len(names)], kinds[(n // len(names)) % len(kinds)]
        vehicle = models[name].vehicle
        # On cells larger than the wheel the planner says that it cannot see steps.
        fine = [r for r in RESOLUTIONS if r <= vehicle.wheel_radius]
        resolution = float(rng.choice(fine))
        block = _KINDS[kind](rng, vehicle, resolution)
        slope = Slope(*(np.tan(rng.uniform(-_STEEPEST, _STEEPEST, 2)) * (rng.random() < 0.7)))
        yield Case(
            kind,
            name,
            block,
            slope,
            resolution,
            float(rng.uniform(-np.pi, np.pi)),
            int(rng.integers(2**31)),
            *_sizes(block, resolution, vehicle),
        )


def _sizes(block: Block, resolution: float, vehicle: Vehicle) -> tuple[Size, Size]:
    """What is there for sure, and what may be: outlines are shown to about a cell."""
    of = [size_of(block.grown(by), vehicle) for by in (-resolution, 0.0, resolution)]
    return Size(*map(min, zip(*of, strict=True))), Size(*map(max, zip(*of, strict=True)))


def map_of(case: Case, vehicle: Vehicle, *, empty: bool = False) -> ElevationMap:
    """The map of a case, each cell the middle one of the heights in it; or without the obstacle."""
    half = 0.5 * LENGTH * vehicle.wheelbase + 4.0 * vehicle.wheelbase
    cells = int(2.0 * half / case.resolution)
    along = (np.arange(cells) - 0.5 * (cells - 1)) * case.resolution
    inside = case.resolution * np.array([-0.4, 0.0, 0.4])
    c, s = np.cos(case.heading), np.sin(case.heading)
    block = Block(0.0, 0.0, 0.0, 0.0, 0.0, 0.0) if empty else case.block
    heights = []
    for dx in inside:
        for dy in inside:
            x, y = np.meshgrid(along + dx, along + dy)
            level = case.slope.along * (c * dx + s * dy) + case.slope.across * (c * dy - s * dx)
            heights.append(height_of(block, case.slope, c * x + s * y, c * y - s * x) - level)
    noise = np.random.default_rng(case.seed).normal(
        0.0, _NOISE * vehicle.wheel_radius, (cells,) * 2
    )
    return ElevationMap(
        elevation=np.median(heights, axis=0) + noise,
        resolution=case.resolution,
        origin=(float(along[0]), float(along[0])),
    )


def path_of(case: Case, vehicle: Vehicle) -> CandidatePath:
    """Straight over the middle of the map."""
    half = 0.5 * LENGTH * vehicle.wheelbase
    ahead = np.array([np.cos(case.heading), np.sin(case.heading)])
    return CandidatePath(case.kind, np.stack([-half * ahead, half * ahead]))


# ------------------------------------------------------------------------------------ kinds

_Draw = Callable[[np.random.Generator, Vehicle, float], Block]


def _share(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(_SMALLEST), np.log(_LARGEST))))


def _length(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> float:
    """Half a length that the map can show."""
    least = _FEWEST_CELLS * resolution
    return 0.5 * float(rng.uniform(least, least + 2.0 * vehicle.wheel_radius))


def _rock_under_wheel(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    side = float(rng.choice([-0.5, 0.5])) * vehicle.track_width
    half = _length(rng, vehicle, resolution)
    y = side + float(rng.uniform(-0.5, 0.5)) * vehicle.shape.wheel_width
    return Block(
        0.0, y, float(rng.uniform(-0.8, 0.8)), half, half, _share(rng) * vehicle.shape.max_step
    )


def _rock_between(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    half = min(_length(rng, vehicle, resolution), 0.3 * vehicle.track_width)
    y = float(rng.uniform(-0.15, 0.15)) * vehicle.track_width
    return Block(
        0.0, y, float(rng.uniform(-0.8, 0.8)), half, half, _share(rng) * vehicle.shape.clearance
    )


def _log(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    half = _length(rng, vehicle, resolution)
    return Block(
        0.0, 0.0, float(rng.uniform(-0.6, 0.6)), half, FAR, _share(rng) * vehicle.shape.max_step
    )


def _step(sign: float) -> _Draw:
    def draw(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
        yaw = float(rng.uniform(-0.6, 0.6))
        return Block(
            FAR * np.cos(yaw),
            FAR * np.sin(yaw),
            yaw,
            FAR,
            2.0 * FAR,
            sign * _share(rng) * vehicle.shape.max_step,
        )

    return draw


def _ditch(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    half = 0.5 * max(float(rng.uniform(0.3, 7.0)) * vehicle.wheel_radius, 2.5 * resolution)
    return Block(
        0.0, 0.0, float(rng.uniform(-0.5, 0.5)), half, FAR, -_share(rng) * vehicle.shape.max_step
    )


def _hole(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    side = float(rng.choice([-0.5, 0.5])) * vehicle.track_width
    half = max(_length(rng, vehicle, resolution), 0.8 * vehicle.shape.wheel_width)
    y = side + float(rng.uniform(-0.3, 0.3)) * half
    return Block(
        0.0, y, float(rng.uniform(-0.8, 0.8)), half, half, -_share(rng) * vehicle.shape.max_step
    )


def _wall(rng: np.random.Generator, vehicle: Vehicle, resolution: float) -> Block:
    side = float(rng.choice([-1.0, 1.0]))
    near = 0.5 * vehicle.shape.width / _share(rng)
    half = _length(rng, vehicle, resolution)
    height = float(rng.uniform(1.5, 4.0)) * vehicle.shape.clearance
    return Block(0.0, side * (near + half), 0.0, 4.0 * half, half, height)


_KINDS: Mapping[str, _Draw] = {
    "rock under a wheel": _rock_under_wheel,
    "rock between the wheels": _rock_between,
    "log": _log,
    "step up": _step(1.0),
    "drop": _step(-1.0),
    "ditch": _ditch,
    "hole": _hole,
    "wall": _wall,
}
