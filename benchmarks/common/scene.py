"""Ground, vehicle and candidates of the planner benchmarks, the same on every machine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from slopewise.services.io.model_file import read_model, shipped_models

SPACING = 0.25  # Between stations in the plan view [m]
_SEED = 7  # of grounds and candidates
_SIZE = 80.0  # [m] edge of the map, enough for 100 stations from its middle
_RESOLUTION = 0.2  # [m] finer than a wheel, so that the swept footprint is checked in full
_MAX_GRADE = np.deg2rad(13.0)  # within the trained grades of the vehicle
_ROUGHNESS = 0.01  # [m] noise of the cells, one standard deviation


@dataclass(frozen=True, slots=True)
class BenchmarkScene:
    """M candidates of N stations on one map."""

    elevation_map: ElevationMap  # ground
    model: Model  # vehicle, braking, limits
    x: Floats  # x, y: positions, shape (N, M) [m]
    y: Floats
    count: Ints  # number of stations, shape (M,)

    def plan(self) -> TimeOptimalBatch:
        """Solve all candidates, from poses to time-optimal plans with their cost."""
        names = tuple(str(j) for j in range(len(self.count)))
        paths = PathBatch.of_stations(names, self.x, self.y, self.count)
        return time_optimal_batch(self.elevation_map, paths, self.model)


def fan(stations: int, candidates: int) -> BenchmarkScene:
    """Arcs from one pose, as of a local planner; patches of unknown ground block some."""
    rng = np.random.default_rng(_SEED)
    travelled = SPACING * np.arange(stations)[:, None]
    heading = rng.uniform(-0.6, 0.6, candidates) + rng.uniform(-0.05, 0.05, candidates) * travelled
    x = 10.0 + SPACING * np.cumsum(np.cos(heading), axis=0)
    y = 0.5 * _SIZE + SPACING * np.cumsum(np.sin(heading), axis=0)
    return BenchmarkScene(hills(patches=12), atv(), x, y, np.full(candidates, stations))


def hills(patches: int) -> ElevationMap:
    """Waves of many lengths within the trained grades, with roughness and unknown patches."""
    rng = np.random.default_rng(_SEED)
    along = np.arange(0.0, _SIZE, _RESOLUTION)
    x, y = np.meshgrid(along, along)
    height = np.zeros_like(x)
    for length in np.geomspace(5.0, 40.0, 24):
        turn, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        wave = 2.0 * np.pi / length * (np.cos(turn) * x + np.sin(turn) * y) + phase
        height += length * np.sin(wave)
    slope = np.hypot(*np.gradient(height, _RESOLUTION))
    height *= np.tan(_MAX_GRADE) / slope.max()
    height += rng.normal(0.0, _ROUGHNESS, height.shape)
    for _ in range(patches):
        row, column = rng.integers(0, len(along), 2)
        size = int(rng.integers(3, 12))
        height[row : row + size, column : column + size] = np.nan
    return ElevationMap(elevation=height, resolution=_RESOLUTION, origin=(0.0, 0.0))


@cache
def shipped(name: str) -> Model:
    """A shipped model, always the same object."""
    return read_model(shipped_models()[name])


def atv() -> Model:
    """The shipped all-terrain vehicle, without width and clearance of its body."""
    model = shipped("atv")
    vehicle = replace(model.vehicle, width=None, ground_clearance=None)
    return replace(model, vehicle=vehicle, braking=replace(model.braking, covariance=None))
