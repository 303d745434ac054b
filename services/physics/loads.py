"""Loads of axles, sides and wheels, as shares of what they carry standing level; and friction.

With n = cos θ cos φ + κ_v v²/g the normal force as a share of the weight, a_x the deceleration and
a_y the lateral acceleration, moments about the contact lines give

    rear   n − h/(L − c) · (a_x/g − sin θ)        front   n + h/c · (a_x/g − sin θ)
    left   n − 2 h/B · (cos θ sin φ + a_y/g)      right   n + 2 h/B · (cos θ sin φ + a_y/g)

with c = cg_x and h = cg_z. A wheel has what its axle and its side lose together: the lateral moment
is divided between the axles as the level load is. Source: free body; Braking (3)–(5) and Slip
(18)–(21), corrected, with the normal force of a crest.

Friction limits: an ellipse shared by slope, turn, drive and brakes, and locked axles,
(F_x/μN)² + (F_y/μN)² <= 1 with N = W (cos θ cos φ + κ_v v²/g) and F_y = W (cos θ sin φ + a_y/g).
The rear axle locks where its part (1 − β) of F_b exceeds μ times its load, which braking takes
from it: F_b/W = μ (L − c) n / ((1 − β) L + μ h), with what the ellipse leaves of μ.
Source: free body; Braking Sec. 1.2 and 5.2 name lock-up and give no formula.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.models.vehicle import Vehicle


class LoadShares(NamedTuple):
    """Least loads as shares of the level static ones; any shape."""

    rear: Floats
    front: Floats
    side: Floats
    wheel: Floats


class BodyAttitude(NamedTuple):
    """How the vehicle stands at places of any shape."""

    sine: Floats  # sin θ
    normal_ratio: Floats  # cos θ cos φ
    cross_slope_ratio: Floats  # cos θ sin φ
    vertical_curvature: Floats  # κ_v, of which only crests take load [1/m]
    turn: Floats  # κ / cos φ, the lateral acceleration for each unit of v² [1/m]


def shares_of(
    vehicle: Vehicle,
    pose: BodyAttitude,
    speed_sq: Floats,
    deceleration: Floats,
    *,
    crest: bool = True,
) -> LoadShares:
    """Shares at v² [m²/s²] while slowing down [m/s²]; without ``crest`` as on an even slope."""
    height, ahead = vehicle.cg_z, vehicle.cg_x
    behind = vehicle.wheelbase - ahead
    normal = pose.normal_ratio + (
        np.minimum(pose.vertical_curvature, 0.0) * speed_sq / GRAVITY if crest else 0.0
    )
    forward = height * (deceleration / GRAVITY - pose.sine)
    sideways = (
        2.0
        * height
        / vehicle.track_width
        * np.abs(pose.cross_slope_ratio + pose.turn * speed_sq / GRAVITY)
    )
    rear, front = normal - forward / behind, normal + forward / ahead
    return LoadShares(rear, front, normal - sideways, np.minimum(rear, front) - sideways)


def attitude_of(
    grade: Floats, roll: Floats, vertical_curvature: Floats, curvature: Floats
) -> BodyAttitude:
    """The pose on slopes [rad], with vertical and plan-view curvature [1/m]."""
    cos_grade, cos_roll = np.cos(grade), np.cos(roll)
    return BodyAttitude(
        np.sin(grade),
        cos_grade * cos_roll,
        cos_grade * np.sin(roll),
        vertical_curvature,
        curvature / cos_roll,
    )


def braking_cap(vehicle: Vehicle, pose: BodyAttitude, friction: Floats, speed_sq: Floats) -> Floats:
    """Most that F_b/W can be at v² [m²/s²]."""
    normal, lateral = _normal_and_lateral(pose, speed_sq)
    left: Floats = np.sqrt(np.maximum((friction * normal) ** 2 - lateral * lateral, 0.0))
    front = _front_part(vehicle)
    if front is None:
        return left
    along = left / np.maximum(normal, 1e-9)
    rear_part = (1.0 - front) * vehicle.wheelbase + along * vehicle.cg_z
    lock: Floats = left * (vehicle.wheelbase - vehicle.cg_x) / rear_part
    return np.minimum(left, lock)


def _front_part(vehicle: Vehicle) -> float | None:
    """β; None where wheels of a side turn as one, so that no axle locks alone."""
    if vehicle.front_brake_share is not None:
        return vehicle.front_brake_share
    return vehicle.cg_x / vehicle.wheelbase if vehicle.drive == "ackermann" else None


def utilisation(pose: BodyAttitude, friction: Floats, speed_sq: Floats, along: Floats) -> Floats:
    """Share of the ellipse that is used by a force F_x/W along the path, and by turn and bank."""
    normal, lateral = _normal_and_lateral(pose, speed_sq)
    grip = np.maximum(friction * normal, 1e-9)
    share: Floats = np.hypot(along, lateral) / grip
    return share


def _normal_and_lateral(pose: BodyAttitude, speed_sq: Floats) -> tuple[Floats, Floats]:
    normal = np.maximum(
        pose.normal_ratio + np.minimum(pose.vertical_curvature, 0.0) * speed_sq / GRAVITY, 0.0
    )
    return normal, pose.cross_slope_ratio + pose.turn * speed_sq / GRAVITY
