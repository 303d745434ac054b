"""Ground, vehicle and candidates of the planner benchmarks, the same on every machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Braking, Limits, Model, Terrain
from slopewise.models.vehicle import Vehicle
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch

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
        paths = PathBatch(names, self.x, self.y, self.count, None)
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


def atv() -> Model:
    """A 500 kg skid-steered all-terrain vehicle."""
    return Model(
        name="atv",
        vehicle=Vehicle(
            mass=500.0,
            wheelbase=1.2,
            track_width=1.0,
            cg_x=0.6,
            cg_z=0.55,
            wheel_radius=0.28,
            drive="skid_steer",
            max_wheel_speed=6.0,
            max_drive_force=2500.0,
            max_drive_power=6000.0,
        ),
        braking=Braking(
            m_m=-0.03,
            b_m=-0.35,
            m_b=0.015,
            b_b=0.40,
            dead_time=0.3,
            distance_offset=0.2,
            speed_range=(1.0, 4.0),
            grade_range=(-0.26, 0.26),
        ),
        terrain=Terrain(motion_resistance=0.13, lateral_resistance=0.2, slip_track=1.15),
        limits=Limits(speed=4.0, accel=1.0, decel=1.5, jerk=2.0, lateral_accel=2.0, min_load=0.1),
    )
