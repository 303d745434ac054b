"""Forward and rearward tip-over: the axle that is unloaded must keep a share of its load.

Braking downhill unloads the rear axle: before it lifts it loses its side guidance. Driving uphill
unloads the front. Shares are of the axle's level static load; the ε of Braking Sec. 5.2, a share
of the whole weight, is ``min_rear_share`` (L − cg_x)/L.

Arguments: grade θ, uphill positive, and roll φ, left side up positive [rad]; wheelbase L, centre of
gravity cg_x ahead of the rear axle and cg_z high [m]; min_rear_share, min_front_share: share of the
axle's level static load to keep [1].

Validity and omissions are those of :mod:`slopewise.models.laws.wheel_loads`. Source: Braking (3),
(5), sign corrected, and Sec. 5.2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY

_STEEP = 1e9
"""Slope that no vehicle stands on, returned outside the domain [1]."""


def grade_limit(
    deceleration: Elementwise,
    wheelbase: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
    min_rear_share: Elementwise,
) -> Elementwise:
    """Steepest downhill grade [rad] on which the rear axle keeps its share at a deceleration.

    A cos θ + B sin θ = C with A = L − cg_x, B = cg_z, C = share (L − cg_x) + cg_z a_x/g has the
    roots ψ ± arccos(C/R), R = √(A² + B²), ψ = arctan(B/A). Between them the load suffices; the
    lower one is returned, negative unless the brakes alone take too much. The upper root matters
    only where it lies below π/2, that is C > B: braking near 1 g on a steep climb.
    Without a root: −π/2 where the load suffices down to the vertical, +π/2 where it suffices
    nowhere (C > R). NaN unless the centre of gravity is ahead of the rear axle by less than L.
    Omits: roll, which :func:`slopewise.models.laws.wheel_loads.rear_load_share` has.
    Source: Braking Sec. 5.2.

    Args:
        deceleration: a_x [m/s²], the same on every grade, positive while slowing.
    """
    A = (wheelbase - cg_x) * np.sqrt(np.sign(wheelbase - cg_x))
    B = cg_z
    C = min_rear_share * A + B * deceleration / GRAVITY
    cosine = C / np.sqrt(A * A + B * B)
    root = np.arctan2(B, A) - np.arccos(np.fmin(np.fmax(cosine, -1.0), 1.0))
    nowhere = _STEEP * np.fmax(cosine - 1.0, 0.0)
    limit = np.fmin(np.fmax(root + nowhere, -0.5 * np.pi), 0.5 * np.pi)
    return limit * np.sign(1.0 + np.fabs(cosine))


def rear_share_under_braking(
    grade: Elementwise,
    roll: Elementwise,
    onset_force_ratio: Elementwise,
    wheelbase: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
) -> Elementwise:
    """Share of its level static load the rear axle keeps under the braking model.

    With a_x = g (F_b/W + sin θ) the slope terms of (5) cancel:
    W_r L / W = (L − cg_x) cos θ cos φ − cg_z F_b/W. NaN where cg_x > L: there is no such rear
    axle. Source: Braking (2) in (5).

    Args:
        onset_force_ratio: F_b/W of the stop [1].
    """
    behind = (wheelbase - cg_x) * np.sqrt(np.sign(wheelbase - cg_x))
    return np.cos(roll) * np.cos(grade) - cg_z / behind * onset_force_ratio


def downhill_limit_under_braking(
    slope: float,
    level_force: float,
    wheelbase: float,
    cg_x: float,
    cg_z: float,
    min_rear_share: float,
) -> float:
    """Steepest downhill grade [rad] on which a full stop from a speed leaves the rear its share.

    The lower root of (L − cg_x) cos θ − cg_z (m θ + b) = share (L − cg_x), m and b of Braking (7)
    at the onset speed. The left side is concave in θ, so it suffices between two roots: the lower
    one is bracketed by −π/2 and the grade of the highest load, sin θ = −cg_z m/(L − cg_x). Without
    a root: −π/2 where the load suffices down to the vertical, +π/2 where it suffices nowhere.
    NaN if a number is NaN, or cg_x is not less than L.
    Plain floats, for the design of a vehicle; the planner bounds speeds at the grades it meets.
    Outside the trained grades (about ±15°) the force extrapolates. Omits: roll.
    Source: Braking Sec. 5.2 with (2), (7), (8).

    Args:
        slope: coefficient m = m_m v_i + b_m at the onset speed [1].
        level_force: b = m_b v_i + b_b at the onset speed [1].
    """
    if not (wheelbase > cg_x and math.isfinite(slope + level_force + cg_z + min_rear_share)):
        return math.nan
    lever = cg_z / (wheelbase - cg_x)

    def spare(grade: float) -> float:
        return math.cos(grade) - lever * (slope * grade + level_force) - min_rear_share

    vertical = -0.5 * math.pi
    best = math.asin(min(max(-lever * slope, -1.0), 1.0))
    if spare(vertical) >= 0.0:
        return vertical
    if spare(best) < 0.0:
        return -vertical
    return float(brentq(spare, vertical, best, xtol=1e-12))


def drive_accel_limit(
    grade: Elementwise,
    roll: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
    min_front_share: Elementwise,
) -> Elementwise:
    """Highest forward acceleration [m/s²] with which the front axle keeps its share.

    a = g (cg_x (cos φ cos θ − share)/cg_z − sin θ): rearward tip-over under drive, worst uphill.
    The wheelbase cancels. Negative where the front is too light even at constant speed.
    Source: Braking (5), slope term corrected, with acceleration −a_x.
    """
    spare = np.cos(roll) * np.cos(grade) - min_front_share
    return GRAVITY * (cg_x * spare / cg_z - np.sin(grade))
