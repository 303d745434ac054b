"""What the ground itself allows: over crests, through dips, by its friction and its roughness."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws.crest import crest_speed_sq, dip_speed_sq
from slopewise.models.laws.friction_ellipse import lateral_speed_sq
from slopewise.models.laws.wheel_loads import (
    front_load_share,
    left_load_share,
    rear_load_share,
    right_load_share,
)
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import HOLDING, SPENT, speed_excess
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.swept.hazards import swept_hazards


def contact_curves(
    elevation_map: ElevationMap, profile: TerrainProfile, ground: BrakingGround, model: Model
) -> dict[Limiting, Floats]:
    """Highest speed that each of them allows, (N,) each [m/s]; friction only where it is known."""
    curves = {Limiting.CREST: _crests(profile, ground, model)}
    if ground.friction is not None:
        curves[Limiting.FRICTION] = _friction(profile, ground.friction[:, 0], model)
    rough = swept_hazards(elevation_map, profile, model).rows.rough_speed
    if rough.size:
        curves[Limiting.ROUGHNESS] = rough[:, 0]
    return curves


def _crests(profile: TerrainProfile, ground: BrakingGround, model: Model) -> Floats:
    """By the load of every wheel and the brakes' force, in dips by the vertical acceleration."""
    vehicle, limits = model.vehicle, planning_limits(model)
    grade, roll, bend = profile.grade[:, 0], profile.roll[:, 0], profile.vertical_curvature[:, 0]
    up = np.cos(grade) * np.cos(roll)
    along = (vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z)
    across = (vehicle.track_width, vehicle.cg_z)
    axle = np.minimum(
        rear_load_share(grade, roll, 0.0, *along), front_load_share(grade, roll, 0.0, *along)
    )
    side = np.minimum(
        left_load_share(grade, roll, 0.0, *across), right_load_share(grade, roll, 0.0, *across)
    )
    loads = crest_speed_sq(axle + side - up, limits.min_load, bend)
    slow, slope = ground.slowest[:, 0], ground.lower_slope[:, 0]
    fast = np.maximum(np.minimum(limits.speed, ground.fastest[:, 0]), slow)
    force = ground.lower_intercept[:, 0] + np.minimum(slow * slope, fast * slope)
    spare = SPENT * np.maximum(force + np.sin(grade) - HOLDING, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.where(force > 0.0, spare / (force * limits.crest_share), np.inf)
    brakes = crest_speed_sq(up * np.minimum(left, 1.0 / np.finfo(float).eps), 0.0, bend)
    passed = np.sqrt(np.minimum(loads, brakes))
    begun = speed_excess(profile, ground, limits.resistance)[:, 0]
    reached = begun + limits.decel * ground.dead_time[:, 0]
    crest: Floats = np.maximum(passed - reached, 0.5 * passed)
    dip: Floats = np.sqrt(dip_speed_sq(limits.vertical_accel, bend))
    return np.minimum(crest, dip)


def _friction(profile: TerrainProfile, friction: Floats, model: Model) -> Floats:
    """By slope, bank and turn, with what is left along the way."""
    limits = planning_limits(model)
    grade, roll, bend = profile.grade[:, 0], profile.roll[:, 0], profile.curvature[:, 0]
    resistance = limits.resistance + limits.turning_drag * np.abs(bend)
    needed = np.maximum(np.abs(np.sin(grade)), np.sin(grade) + resistance * np.cos(grade))
    along = needed / (np.cos(grade) * np.cos(roll))
    speed: Floats = np.sqrt(
        lateral_speed_sq(grade, roll, bend, profile.vertical_curvature[:, 0], friction, along)
    )
    return speed
