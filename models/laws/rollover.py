"""Sideways tip-over: both sides must keep a share of their load in turns and on cross slopes.

Arguments: grade θ, uphill positive, and roll φ, left side up positive [rad]; track_width B and
cg_z, height of the centre of gravity [m]; min_side_share of the level static load W/2 to keep [1].

Validity: quasi-static, rigid body, locally plane ground. Omits: suspension roll, tripping on a rut
or stone, and sliding, which may come first.

Source: Slip (18)–(21), sign of (21) corrected, with the lateral inertia added.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY


def lateral_accel_limits(
    grade: Elementwise,
    roll: Elementwise,
    track_width: Elementwise,
    cg_z: Elementwise,
    min_side_share: Elementwise,
) -> tuple[Elementwise, Elementwise]:
    """Lateral accelerations (lowest, highest) [m/s²] that leave both sides their share.

    a_y = g (∓ B (cos φ cos θ − share)/(2 cg_z) − cos θ sin φ). The lowest (a right turn) is set
    by the right side, the highest (a left turn) by the left. If the lowest exceeds the highest no
    lateral acceleration will do; if 0 is not between them, standing still will not.
    """
    tilt = np.cos(grade) * np.sin(roll)
    reach = 0.5 * track_width / cg_z * (np.cos(roll) * np.cos(grade) - min_side_share)
    return GRAVITY * (-reach - tilt), GRAVITY * (reach - tilt)


def path_lateral_accel(
    speed_sq: Elementwise, curvature: Elementwise, roll: Elementwise
) -> Elementwise:
    """Lateral acceleration a_y = v² κ / cos φ [m/s²] in the body frame, positive to the left.

    The path is drawn in plan view, with curvature κ; the vehicle drives it on a plane with normal
    n. With T the unit tangent, T × T' is κ_g n for the curvature κ_g within the plane, and its
    vertical part over the cube of the horizontal part cos θ of T is the plan-view curvature:
    κ = κ_g n_z / cos³ θ. As n_z = cos θ cos φ, κ_g = κ cos² θ / cos φ. The factor cos² θ <= 1 is
    dropped, which errs to the safe side in all cases where standing still is within
    :func:`lateral_accel_limits`. Omits: the curvature and twist of the ground.

    Args:
        speed_sq: v² along the path in space [m²/s²].
        curvature: κ of the plan view [1/m], left turn positive.
        roll: φ [rad], |φ| < π/2; NaN beyond.
    """
    upright = np.cos(roll)
    return speed_sq * curvature / (upright * np.sqrt(np.sign(upright)))
