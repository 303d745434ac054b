"""The model's scalars in the form that compiled code wants them."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.effects.registry import crest_share as crest_share_of
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY


class PlanningLimits(NamedTuple):
    """Vehicle, terrain and limits as plain numbers; SI.

    Attributes:
        rear_lever: cg_z / (L − cg_x). front_lever: cg_z / cg_x. side_lever: 2 cg_z / B.
        resistance: f_r that the drive has to overcome.
        rolling: f_r that slows the vehicle with its drive cut.
        turning_drag: μ_t L / 2 of a skid-steer vehicle, else 0 [m].
        half_slip_track: B_s / 2 of a skid-steer vehicle, else B / 2 [m].
        ahead: cg_x / L. high: cg_z / L. brake_share: front axle's, -1 where none locks alone.
        crest_share: share of the load lost over a crest that the braking force loses as well.
        holding: share of the slope that brakes and friction must hold at rest: all of it.
        specific_force: max drive force / weight. specific_power: max drive power / weight [m/s].
    """

    rear_lever: float
    front_lever: float
    side_lever: float
    min_load: float
    resistance: float
    rolling: float
    turning_drag: float
    half_slip_track: float
    max_wheel_speed: float
    specific_force: float
    specific_power: float
    speed: float
    accel: float
    decel: float
    lateral_accel: float
    vertical_accel: float
    ahead: float
    high: float
    brake_share: float
    crest_share: float
    holding: float


def planning_limits(model: Model) -> PlanningLimits:
    """Collect the scalars of a model."""
    vehicle, limits, terrain = model.vehicle, model.limits, model.terrain
    weight = vehicle.mass * GRAVITY
    skid_steer = vehicle.drive == "skid_steer"
    crest_share = crest_share_of(model.effect)
    return PlanningLimits(
        rear_lever=vehicle.cg_z / (vehicle.wheelbase - vehicle.cg_x),
        front_lever=vehicle.cg_z / vehicle.cg_x,
        side_lever=2.0 * vehicle.cg_z / vehicle.track_width,
        min_load=float(limits.min_load),
        resistance=float(terrain.motion_resistance),
        rolling=float(terrain.rolling_while_braking),
        turning_drag=0.5 * terrain.lateral_resistance * vehicle.wheelbase if skid_steer else 0.0,
        half_slip_track=0.5 * (terrain.slip_track if skid_steer else vehicle.track_width),
        max_wheel_speed=float(vehicle.max_wheel_speed),
        specific_force=vehicle.max_drive_force / weight,
        specific_power=vehicle.max_drive_power / weight,
        speed=float(limits.speed),
        accel=float(limits.accel),
        decel=float(limits.decel),
        lateral_accel=float(limits.lateral_accel),
        vertical_accel=float(limits.vertical_accel),
        ahead=vehicle.cg_x / vehicle.wheelbase,
        high=vehicle.cg_z / vehicle.wheelbase,
        brake_share=-1.0 if vehicle.brake_share is None else float(vehicle.brake_share),
        crest_share=1.0 if crest_share is None else crest_share,
        holding=1.0,
    )
