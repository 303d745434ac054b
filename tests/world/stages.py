"""Stages of planning one by one: the ground under paths, the brakes on it, and speed bounds."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.path import batch
from tests.world.ground import straight


def profile_of(
    model: Model, elevation_map: ElevationMap, *paths: CandidatePath, spacing: float = 0.25
) -> TerrainProfile:
    """Ground under paths, a straight one of 20 m if none is given."""
    side = batch(list(paths) or [straight(20.0)], spacing)
    return terrain_profile(
        elevation_map, side.x, side.y, side.count, model.vehicle, model.steering_geometry
    )


def braking_ground_of(
    model: Model,
    elevation_map: ElevationMap,
    *paths: CandidatePath,
    spacing: float = 0.25,
    **known: Any,
) -> tuple[TerrainProfile, BrakingGround]:
    """The same with the brakes on it; `known` are conditions and uncertainty."""
    profile = profile_of(model, elevation_map, *paths, spacing=spacing)
    return profile, ground_along(profile, model, elevation_map.class_names, **known)


def bounds_of(
    model: Model,
    elevation_map: ElevationMap,
    *paths: CandidatePath,
    spacing: float = 0.25,
    clear: float = np.inf,
    curvature: float | None = None,
    closed_form: bool = True,
) -> tuple[TerrainProfile, BrakingGround, SpeedBounds]:
    """The same with speed bounds; a straight path may be given the curvature of a circle."""
    profile = profile_of(model, elevation_map, *paths, spacing=spacing)
    if curvature is not None:
        profile = dataclasses.replace(profile, curvature=np.full_like(profile.x, curvature))
    ground = ground_along(profile, model, elevation_map.class_names)
    if not closed_form:
        ground = dataclasses.replace(ground, closed_form=False)
    clearance = np.full(profile.x.shape[1], clear)
    return profile, ground, speed_bounds(profile, ground, model, clearance)
