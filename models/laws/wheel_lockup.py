"""Wheel lock-up: an axle locks when its part of the braking force exceeds its friction.

The braking force F_b is divided between the axles by the fixed share ``front_brake_share``. The
loads move with F_b: with a_x = g (F_b/W + sin θ) the axle loads are
W_f L/W = cg_x c + cg_z F_b/W and W_r L/W = (L − cg_x) c − cg_z F_b/W, c = cos θ cos φ.

Arguments: grade θ, uphill positive, and roll φ, left side up positive [rad]; front_brake_share β of
the force, 0 to 1; sliding_friction μ_s [1]; wheelbase L, centre of gravity cg_x ahead of the rear
axle and cg_z high [m].

Validity: straight braking. Omits: friction used up sideways (turns, cross slopes), peak friction
above the sliding one, and that locked wheels change the division. Source: Braking Sec. 1.2 and
5.2, which name lock-up and give no formula; derived here from (2), (5) corrected.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise

_MIN_LEVER = 1e-9
"""Keeps the load transfer finite for a lever of zero [m]."""
_EPSILON = 1e-300
"""Makes the sign of 0 positive: 0 lies within the domain."""


def lockup_force_ratios(
    grade: Elementwise,
    roll: Elementwise,
    front_brake_share: Elementwise,
    sliding_friction: Elementwise,
    wheelbase: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
) -> tuple[Elementwise, Elementwise]:
    """F_b/W [1] at which (front, rear) axle locks; the lower one locks first.

    Front: μ_s cg_x c / (β L − μ_s cg_z). Rear: μ_s (L − cg_x) c / ((1 − β) L + μ_s cg_z).
    Braking loads the front: with β L <= μ_s cg_z its friction grows faster than its part of the
    force and it never locks; a number above 10⁶ stands for that. The lower one is never above
    :func:`friction_cap`, and both equal it for the ideal share β = (cg_x + μ_s cg_z)/L. NaN unless
    0 <= β <= 1 and μ_s >= 0.
    For checking a single axle; no bound of the planner divides the force so far.
    """
    inside = np.sqrt(np.sign(front_brake_share * (1.0 - front_brake_share) + _EPSILON))
    mu = sliding_friction * np.sqrt(np.sign(sliding_friction + _EPSILON))
    friction = mu * np.cos(grade) * np.cos(roll) * inside
    transfer = mu * cg_z
    lever = front_brake_share * wheelbase - transfer
    front = np.fmax(lever, _MIN_LEVER) * np.sign(1.0 + np.fabs(lever))
    rear = (1.0 - front_brake_share) * wheelbase + transfer
    return friction * cg_x / front, friction * (wheelbase - cg_x) / rear


def friction_cap(
    grade: Elementwise, roll: Elementwise, sliding_friction: Elementwise
) -> Elementwise:
    """F_b/W [1] with all wheels sliding, μ_s cos θ cos φ: no division of the force gives more.

    NaN where μ_s < 0.
    """
    mu = sliding_friction * np.sqrt(np.sign(sliding_friction + _EPSILON))
    return mu * np.cos(grade) * np.cos(roll)
