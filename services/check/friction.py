"""Limits of friction: an ellipse shared by slope, turn, drive and brakes, and locked axles.

(F_x/μN)² + (F_y/μN)² <= 1 with N = W (cos θ cos φ + κ_v v²/g) and F_y = W (cos θ sin φ + a_y/g).
The rear axle locks where its part (1 − β) of F_b exceeds μ times its load, which braking takes
from it: F_b/W = μ (L − c) n / ((1 − β) L + μ h), with what the ellipse leaves of μ.
Source: free body; Braking Sec. 1.2 and 5.2 name lock-up and give no formula.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.loads import BodyAttitude


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
