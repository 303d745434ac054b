"""Obstacles of the swept footprint, and candidates over them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.path import batch
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.hazards import Hazards, swept_hazards
from tests.planner.scenes import ground_map, model_of, tables_with

Height = Callable[[np.ndarray, np.ndarray], Any]

FINE = 0.1
"""Edge of the cells of most maps here [m]; the wheels have a radius of 0.28 m."""


@dataclass(frozen=True)
class Met:
    """Hazards of one candidate: codes and roughness speeds of its stations, and their places."""

    hazards: Hazards
    profile: TerrainProfile

    @property
    def bar(self) -> int:
        """Code of the first blocked station, 0 without one."""
        codes = self.hazards.rows.code[:, 0]
        return int(codes[np.argmax(codes > 0)])

    @property
    def station(self) -> int:
        """Index of that station, -1 without one."""
        codes = self.hazards.rows.code[:, 0]
        return int(np.argmax(codes > 0)) if codes.any() else -1

    @property
    def reason(self) -> str:
        met = self.hazards.obstacle(0, self.station)
        return "" if met is None else met.words

    @property
    def slowest(self) -> float:
        """The lowest rough speed of all stations [m/s]."""
        rough = self.hazards.rows.rough_speed
        return float(rough.min()) if rough.size else np.inf


def ground(height: Height, resolution: float = FINE, **options: Any) -> ElevationMap:
    options.setdefault("x", (-3.0, 25.0))
    options.setdefault("y", (-4.0, 4.0))
    return ground_map(height, resolution=resolution, **options)


def met(
    elevation_map: ElevationMap, path: CandidatePath, tables: Mapping[str, Any] | None = None
) -> Met:
    """One candidate over a map."""
    return met_by(elevation_map, path, model_of(tables or tables_with()))


def met_by(elevation_map: ElevationMap, path: CandidatePath, model: Model) -> Met:
    part = batch([path], PlannerSettings().spacing_on(elevation_map.resolution))
    vehicle = model.vehicle
    profile = terrain_profile(
        elevation_map, part.x, part.y, part.count, vehicle.wheelbase, vehicle.track_width
    )
    return Met(swept_hazards(elevation_map, profile, model), profile)
