"""Friction is shared: what slope and turn take sideways is missing for braking and driving.

(F_x/(μ N))² + (F_y/(μ N))² ≤ 1 with the normal load N = W (cos θ cos φ + κ_v v²/g) and the side
force F_y = W (sin φ cos θ + κ v²/g), which a bank that falls away from the turn makes larger.

Arguments: grade θ, uphill positive, and roll φ, left side up positive [rad]; curvature κ of the
path in the plan view, left turn positive, and vertical_curvature κ_v = dθ/ds, negative over a crest
[1/m]; speed_sq v² [m²/s²]; friction μ, normal N/W, side_force F_y/W [1].

Validity: one coefficient of friction in all directions, the vehicle as one point. Omits: single
wheels and axles (:mod:`slopewise.models.laws.wheel_lockup`), yaw moments, and that skid-steered
wheels slip sideways in every turn, which lowers the remainder along the path.

Source: neither paper; the friction ellipse of vehicle dynamics, with the loads of Slip (18)–(21).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY

TURNING_SHARE = 0.8
"""Share of the friction that a slope leaves which a turn may use: 0.6 stay for the brakes."""

_EPSILON = 1e-300
"""Makes the sign of 0 positive: 0 lies within the domain."""
_NONE = 1e-12
"""In place of a curvature or a force of zero."""


def side_force_ratio(
    grade: Elementwise, roll: Elementwise, curvature: Elementwise, speed_sq: Elementwise
) -> Elementwise:
    """F_y/W = sin φ cos θ + κ v²/g [1], positive where it pushes to the right."""
    return np.sin(roll) * np.cos(grade) + curvature * speed_sq / GRAVITY


def normal_ratio(
    grade: Elementwise, roll: Elementwise, vertical_curvature: Elementwise, speed_sq: Elementwise
) -> Elementwise:
    """N/W = cos θ cos φ + κ_v v²/g [1], nothing left where the vehicle would fly; NaN of NaN."""
    carried = np.cos(grade) * np.cos(roll) + vertical_curvature * speed_sq / GRAVITY
    return 0.5 * (carried + np.fabs(carried))


def braking_left(
    friction: Elementwise, normal: Elementwise, side_force: Elementwise
) -> Elementwise:
    """F_x/W that the ellipse leaves for brakes or drive, √((μ N)² − F_y²)/W [1]; 0 where it slides.

    NaN where μ < 0.
    """
    held = friction * np.sqrt(np.sign(friction + _EPSILON)) * normal
    product = (held - side_force) * (held + side_force)
    return np.sqrt(0.5 * (product + np.fabs(product)))


def lateral_speed_sq(
    grade: Elementwise,
    roll: Elementwise,
    curvature: Elementwise,
    vertical_curvature: Elementwise,
    friction: Elementwise,
    along: Elementwise,
) -> Elementwise:
    """Highest v² at which bank, turn and crest leave friction along the path [m²/s²].

    |F_y| ≤ s N with s = 0.8 μ + 0.2 b, b = |sin φ| cos θ/c, c = cos θ cos φ. A turn takes at most
    :data:`TURNING_SHARE` of the friction that the bank leaves. Nor does it take more than
    √(μ² − k²), with k halfway between the need along the path and μ, so that the vehicle can still
    speed up; over a crest the load stays large enough for a quarter of that. Never below b: where
    the bank alone is held, standing is allowed. Of κ_v only the load lost over a crest is used.
    Huge where no speed is too high; NaN where μ < 0.

    Args:
        along: F_x/N needed to hold the speed or the vehicle [1].
    """
    upright = np.cos(grade) * np.cos(roll)
    bank = np.sin(roll) * np.cos(grade)
    taken = np.abs(bank) / upright
    reserved = along + 0.5 * np.fmax(friction - along, 0.0)
    held = along + 0.25 * np.fmax(friction - along, 0.0)
    share = TURNING_SHARE * friction + (1.0 - TURNING_SHARE) * taken
    share = np.fmin(share, np.sqrt(np.fmax(friction * friction - reserved * reserved, 0.0)))
    share = np.fmax(share, taken)
    turn, falls = np.abs(curvature), np.fmax(-vertical_curvature, 0.0)
    # A left turn (κ > 0) on ground that rises to the left pushes outward twice.
    outward = np.sign(curvature) * bank
    out = np.fmax(share * upright - outward, 0.0) / np.fmax(turn + share * falls, _NONE)
    down = np.fmax(share * upright + outward, 0.0) / np.fmax(share * falls - turn, _NONE)
    over = upright * np.fmax(1.0 - held / np.fmax(reserved, _NONE), 0.0) / np.fmax(falls, _NONE)
    # A maximum or minimum drops NaN: this does not.
    sound = _EPSILON * (
        np.sqrt(friction)
        + np.fabs(grade)
        + np.fabs(roll)
        + np.fabs(curvature)
        + np.fabs(vertical_curvature)
        + np.fabs(along)
    )
    return GRAVITY * np.fmin(over, np.fmin(out, down)) + sound
