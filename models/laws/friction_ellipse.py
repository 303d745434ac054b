"""Friction is shared: what slope and turn take sideways is missing for braking and driving.

(F_x/(μ N))² + (F_y/(μ N))² ≤ 1 with the normal load N = W (cos θ cos φ + κ_v v²/g) and the side
force F_y = W (sin φ cos θ + κ v²/g), which a bank that falls away from the turn makes larger.

Validity: one coefficient of friction in all directions, the vehicle as one point. Omits: single
wheels and axles (:mod:`models.laws.wheel_lockup`), yaw moments, and that skid-steered wheels slip
sideways in every turn, which lowers what is left along the way.

Source: neither paper; the friction ellipse of vehicle dynamics, with the loads of Slip (18)–(21).
"""

from __future__ import annotations

import numpy as np

from models.arrays import Elementwise
from models.quantity import GRAVITY

_HAIR = 1e-300
TURNING_SHARE = 0.8
"""Share of the friction that a slope leaves which a turn may use: 0.6 stay for the brakes."""


def side_force_ratio(
    grade: Elementwise, roll: Elementwise, curvature: Elementwise, speed_sq: Elementwise
) -> Elementwise:
    """F_y/W = sin φ cos θ + κ v²/g [1], positive where it pushes to the right.

    Args:
        grade: θ [rad]. roll: φ [rad], left side up positive.
        curvature: κ of the path in the plan view [1/m], left turn positive.
        speed_sq: v² [m²/s²].
    """
    return np.sin(roll) * np.cos(grade) + curvature * speed_sq / GRAVITY


def normal_ratio(
    grade: Elementwise, roll: Elementwise, vertical_curvature: Elementwise, speed_sq: Elementwise
) -> Elementwise:
    """N/W = cos θ cos φ + κ_v v²/g [1], nothing left where the vehicle would fly; NaN of NaN.

    Args:
        grade: θ [rad]. roll: φ [rad].
        vertical_curvature: κ_v = dθ/ds, negative over a crest [1/m].
        speed_sq: v² [m²/s²].
    """
    carried = np.cos(grade) * np.cos(roll) + vertical_curvature * speed_sq / GRAVITY
    return 0.5 * (carried + np.fabs(carried))


def braking_left(
    friction: Elementwise, normal: Elementwise, side_force: Elementwise
) -> Elementwise:
    """F_x/W that the ellipse leaves for brakes or drive, √((μ N)² − F_y²)/W [1]; 0 where it slides.

    NaN where μ < 0.

    Args:
        friction: μ [1]. normal: N/W [1]. side_force: F_y/W [1].
    """
    held = friction * np.sqrt(np.sign(friction + _HAIR)) * normal
    room = (held - side_force) * (held + side_force)
    return np.sqrt(0.5 * (room + np.fabs(room)))


def lateral_speed_sq(
    grade: Elementwise,
    roll: Elementwise,
    curvature: Elementwise,
    vertical_curvature: Elementwise,
    friction: Elementwise,
) -> Elementwise:
    """Highest v² at which bank and turn use no more friction than a turn may [m²/s²].

    |F_y| ≤ (0.8 μ + 0.2 |sin φ| cos θ/c) N, c = cos θ cos φ: of the friction that the bank leaves
    a turn takes at most :data:`TURNING_SHARE`. 0 where the bank takes all of it, huge where no
    speed is too high. NaN where μ < 0.

    Args:
        grade: θ [rad]. roll: φ [rad], left side up positive.
        curvature: κ [1/m], left turn positive.
        vertical_curvature: κ_v [1/m]; only the load lost over a crest counts.
        friction: μ [1].
    """
    upright = np.cos(grade) * np.cos(roll)
    bank = np.sin(roll) * np.cos(grade)
    # A left turn (κ > 0) on ground that rises to the left pushes outward twice.
    outward = np.sign(curvature) * bank
    mu = friction * np.sqrt(np.sign(friction + _HAIR))
    share = TURNING_SHARE * mu + (1.0 - TURNING_SHARE) * np.fabs(bank) / upright
    falling = 0.5 * (np.fabs(vertical_curvature) - vertical_curvature)
    per_speed_sq = (np.fabs(curvature) + share * falling) / GRAVITY
    spare = share * upright - outward
    return 0.5 * (spare + np.fabs(spare)) / (per_speed_sq + _HAIR)
