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
    """N/W = cos θ cos φ + κ_v v²/g [1], nothing left where the vehicle would fly.

    Args:
        grade: θ [rad]. roll: φ [rad].
        vertical_curvature: κ_v = dθ/ds, negative over a crest [1/m].
        speed_sq: v² [m²/s²].
    """
    carried = np.cos(grade) * np.cos(roll) + vertical_curvature * speed_sq / GRAVITY
    return np.fmax(carried, 0.0)


def braking_left(
    friction: Elementwise, normal: Elementwise, side_force: Elementwise
) -> Elementwise:
    """F_x/W that the ellipse leaves for brakes or drive, √((μ N)² − F_y²)/W [1]; 0 where it slides.

    Args:
        friction: μ [1]. normal: N/W [1]. side_force: F_y/W [1].
    """
    room = (friction * normal - side_force) * (friction * normal + side_force)
    return np.sqrt(np.fmax(room, 0.0))


def lateral_speed_sq(
    grade: Elementwise,
    roll: Elementwise,
    curvature: Elementwise,
    vertical_curvature: Elementwise,
    friction: Elementwise,
) -> Elementwise:
    """Highest v² at which bank and turn use no more friction than a turn may [m²/s²].

    |F_y| ≤ (0.8 μ + 0.2 |sin φ| cos θ/c) N, c = cos θ cos φ: of the friction that the bank leaves
    a turn takes at most :data:`TURNING_SHARE`. 0 where the bank takes all of it, inf where no speed
    is too high.

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
    share = TURNING_SHARE * friction + (1.0 - TURNING_SHARE) * np.abs(bank) / upright
    per_speed_sq = (np.abs(curvature) + share * np.fmax(-vertical_curvature, 0.0)) / GRAVITY
    room = np.fmax(share * upright - outward, 0.0)
    return room / np.fmax(per_speed_sq, 1e-300)
