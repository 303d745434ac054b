"""Obstacles of the swept footprint, and candidates over them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.hazards import Hazards, swept_hazards
from tests.world.ground import Height, ground_map
from tests.world.stages import profile_of
from tests.world.vehicles import ATV, SMALL, model_of, tables_with

FINE = 0.1
"""Edge of the cells of most maps here [m]; the wheels have a radius of 0.28 m."""


MODELS = (model_of(ATV), model_of(tables_with(**SMALL)))


@dataclass(frozen=True)
class Met:
    """Hazards of one candidate: codes and roughness speeds of its stations, and their places."""

    hazards: Hazards
    profile: TerrainProfile

    @property
    def bar(self) -> int:
        """Code of the first blocked station, 0 without one."""
        codes = self.hazards.code[:, 0]
        return int(codes[np.argmax(codes > 0)])

    @property
    def station(self) -> int:
        """Index of that station, -1 without one."""
        codes = self.hazards.code[:, 0]
        return int(np.argmax(codes > 0)) if codes.any() else -1

    @property
    def reason(self) -> str:
        met = self.hazards.obstacle(0, self.station)
        return "" if met is None else met.words

    @property
    def slowest(self) -> float:
        """The lowest rough speed of all stations [m/s]."""
        rough = self.hazards.rough_speed
        return float(rough.min()) if rough.size else np.inf


def ground(height: Height, resolution: float = FINE, **options: Any) -> ElevationMap:
    options.setdefault("x", (-3.0, 25.0))
    options.setdefault("y", (-4.0, 4.0))
    return ground_map(height, resolution=resolution, **options)


def rough_ground(seed: int, resolution: float, size: float) -> ElevationMap:
    """Waves, noise, rocks, steps and unknown cells around the limits of a vehicle of this size."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(0.0, 12.0, resolution), np.arange(0.0, 6.0, resolution))
    z = rng.uniform(-0.25, 0.25) * x + rng.uniform(-0.2, 0.2) * y
    for _ in range(rng.integers(0, 4)):
        length, turn = size * rng.uniform(2.0, 12.0), rng.uniform(0.0, np.pi)
        phase = rng.uniform(0.0, 6.3)
        wave = np.sin(2 * np.pi / length * (np.cos(turn) * x + np.sin(turn) * y) + phase)
        z += 0.02 * length * rng.uniform(0.0, 1.0) * wave
    z += rng.choice([0.0, 0.02, 0.05]) * size * rng.standard_normal(z.shape)
    for _ in range(rng.integers(0, 4)):
        at, half = rng.uniform((2.0, 1.0), (10.0, 5.0)), size * rng.uniform(0.05, 0.6)
        inside = (np.abs(x - at[0]) < half) & (np.abs(y - at[1]) < half)
        z[inside] += size * rng.uniform(-0.5, 0.8)
    if rng.random() < 0.3:
        z += size * rng.uniform(-0.3, 0.3) * (np.cos(0.3) * x + np.sin(0.3) * y > 7.0)
    z[rng.random(z.shape) < rng.choice([0.0, 0.0, 0.002])] = np.nan
    return ElevationMap(elevation=z, resolution=resolution, origin=(0.0, 0.0))


def met(
    elevation_map: ElevationMap, path: CandidatePath, tables: Mapping[str, Any] | None = None
) -> Met:
    """One candidate over a map."""
    return met_by(elevation_map, path, model_of(tables or tables_with()))


def met_by(elevation_map: ElevationMap, path: CandidatePath, model: Model) -> Met:
    spacing = PlannerSettings().spacing_on(elevation_map.resolution, model.vehicle)
    profile = profile_of(model, elevation_map, path, spacing=spacing)
    return Met(swept_hazards(elevation_map, profile, model), profile)
