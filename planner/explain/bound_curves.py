"""Every bound on the speed along a plan by itself, for people who want to see them side by side.

By the laws of `models`, station by station; the stopping path, with the loads on it, by the
planner's own bound with all others out of the way. Slow and simple: nothing is planned with them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import drive, rollover, slip_track, turning_resistance
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from slopewise.planner.explain.contact_curves import contact_curves
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan

_FAR = 1e6
"""Replaces a limit that a curve is drawn without [m/s, m/s², W/kg]."""
_HEADROOM = 1.5
"""Speed axis of the curves over the speed limit [1]."""


def bound_curves(
    elevation_map: ElevationMap,
    plan: SpeedPlan,
    model: Model,
) -> dict[Limiting, Floats]:
    """Highest speed that each bound by itself allows, (N,) each [m/s], inf where it allows any."""
    model = within_sight(model, elevation_map, "slow")
    vehicle, limits, terrain = model.vehicle, model.limits, model.terrain
    skid_steer = vehicle.drive == "skid_steer"
    grade, roll, curvature = plan.grade, plan.roll, plan.curvature
    per_speed_sq = rollover.path_lateral_accel(1.0, np.abs(curvature), roll)
    lowest, highest = rollover.lateral_accel_limits(
        grade, roll, vehicle.track_width, vehicle.cg_z, limits.min_load
    )
    outward = np.maximum(np.where(curvature > 0.0, highest, -lowest), 0.0)
    resistance = terrain.motion_resistance
    if skid_steer:
        resistance = resistance + turning_resistance.equivalent_drag_ratio(
            curvature, terrain.lateral_resistance, vehicle.wheelbase
        )
    width = terrain.slip_track if skid_steer else vehicle.track_width
    x, y = (np.ascontiguousarray(values[:, None]) for values in (plan.x, plan.y))
    count = np.array([len(plan.x)])
    elevation_map = averaged_map(elevation_map, vehicle.wheel_radius)
    profile = terrain_profile(elevation_map, x, y, count, vehicle, model.steering_geometry)
    ground = ground_along(profile, model, elevation_map.class_names)
    stopping = _stopping(profile, ground, plan.clear_distance, model)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            Limiting.SPEED_LIMIT: np.full_like(grade, limits.speed),
            Limiting.STOPPING_PATH: stopping,
            Limiting.MODEL_VALIDITY: ground.fastest[:, 0],
            Limiting.LATERAL: np.sqrt(limits.lateral_accel / per_speed_sq),
            Limiting.ROLLOVER: np.where(curvature == 0.0, np.inf, np.sqrt(outward / per_speed_sq)),
            Limiting.WHEEL_SPEED: vehicle.max_wheel_speed
            / slip_track.outer_wheel_speed_ratio(curvature, width),
            Limiting.TRACTION: drive.sustained_speed(
                grade, vehicle.mass, vehicle.max_drive_power, resistance
            ),
            **contact_curves(elevation_map, profile, ground, model),
        }


def _stopping(
    profile: TerrainProfile, ground: BrakingGround, clear_distance: float, model: Model
) -> Floats:
    """What the stopping path and its loads allow, (N,) [m/s]."""
    vehicle, top = model.vehicle, _HEADROOM * model.limits.speed
    free = replace(
        model,
        limits=replace(model.limits, speed=top, lateral_accel=_FAR),
        vehicle=replace(vehicle, max_wheel_speed=_FAR, max_drive_power=_FAR * vehicle.mass),
    )
    anyhow = replace(ground, fastest=np.full_like(ground.fastest, top))
    clear = np.array([clear_distance])
    # What crests take of a stop depends on how fast it may be: nothing binds at the headroom.
    above = _speeds(speed_bounds(profile, anyhow, free, clear))
    slower = replace(free, limits=replace(free.limits, speed=model.limits.speed))
    within = _speeds(speed_bounds(profile, ground, slower, clear))
    bound = np.where(within < 0.999 * model.limits.speed, within, np.maximum(above, within))
    return np.where(bound < 0.999 * top, bound, np.inf)


def _speeds(bounds: SpeedBounds) -> Floats:
    speed: Floats = np.sqrt(np.maximum(bounds.speed_sq_max[:, 0], 0.0))
    return speed
