"""Every bound on the speed along a plan individually, for users who want to see them side by side.

By the planner's own bounds, station by station; the stopping path, with the loads on it, with all
the others lifted. Nothing is planned with them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.swept.hazards import swept_hazards

_FAR = 1e6
"""Replaces a limit that a curve is drawn without [m/s, m/s², W/kg]."""
_HEADROOM = 1.5
"""Speed axis of the curves over the speed limit [1]."""


def bound_curves(
    elevation_map: ElevationMap, plan: SpeedPlan, model: Model
) -> dict[Limiting, Floats]:
    """Highest speed that each bound individually allows, (N,) each [m/s], inf where it allows any.

    Bounds that allow any speed everywhere are not among them.
    """
    model = within_sight(model, elevation_map, "slow")
    x, y = (np.ascontiguousarray(values[:, None]) for values in (plan.x, plan.y))
    count = np.array([len(plan.x)])
    elevation_map = averaged_map(elevation_map, model.vehicle.wheel_radius)
    profile = terrain_profile(elevation_map, x, y, count, model.vehicle, model.steering_geometry)
    ground = ground_along(profile, model, elevation_map.class_names)
    hazards = swept_hazards(elevation_map, profile, model)
    squares = np.full((len(Limiting), len(plan.x)), np.inf)
    clear = np.array([plan.clear_distance])
    speed_bounds(profile, ground, model, clear, hazards=hazards, curves=squares)
    squares[Limiting.STOPPING_PATH] = np.square(_stopping(profile, ground, clear, model))
    # Crests are bounded up to the trained speeds, which may be above the limit.
    np.minimum(squares[0], model.limits.speed**2, out=squares[0])
    curves = zip(Limiting, np.sqrt(squares), strict=True)
    return {bound: curve for bound, curve in curves if np.isfinite(curve).any()}


def _stopping(
    profile: TerrainProfile, ground: BrakingGround, clear: Floats, model: Model
) -> Floats:
    """Speeds that the stopping path and its loads allow, (N,) [m/s]."""
    vehicle, top = model.vehicle, _HEADROOM * model.limits.speed
    free = replace(
        model,
        limits=replace(model.limits, speed=top, lateral_accel=_FAR),
        vehicle=replace(vehicle, max_wheel_speed=_FAR, max_drive_power=_FAR * vehicle.mass),
    )
    anyhow = replace(ground, fastest=np.full_like(ground.fastest, top))
    # What crests take of a stop depends on how fast it may be: nothing binds at the headroom.
    above = _speeds(speed_bounds(profile, anyhow, free, clear))
    slower = replace(free, limits=replace(free.limits, speed=model.limits.speed))
    within = _speeds(speed_bounds(profile, ground, slower, clear))
    bound = np.where(within < 0.999 * model.limits.speed, within, np.maximum(above, within))
    return np.where(bound < 0.999 * top, bound, np.inf)


def _speeds(bounds: SpeedBounds) -> Floats:
    speed: Floats = np.sqrt(np.maximum(bounds.speed_sq_max[:, 0], 0.0))
    return speed
