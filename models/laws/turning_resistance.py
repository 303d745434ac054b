"""Turning resistance of skid steering: moment, thrusts of the sides, drag in a turn.

Left and right are those of a left turn; for a right turn exchange them. Thrusts are magnitudes.

Arguments: coefficients of motion resistance f_r and of lateral_resistance μ_t [1]; normal loads
left_load and right_load of the sides and weight W [N]; wheelbase L, track_width B [m].

Validity: steady turning at low speed, even load of front and rear. Omits: yaw inertia, centrifugal
force, the shift of the pole of turning, and gravity: on a grade the sides also share W sin θ.
Source: Slip (22)–(27); (27) corrected for turns other than on the spot.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise


def turning_moment(
    lateral_resistance: Elementwise, weight: Elementwise, wheelbase: Elementwise
) -> Elementwise:
    """Moment of turning resistance M_r = μ_t W L / 2 [N m]. Source: Slip (24)."""
    return 0.5 * lateral_resistance * weight * wheelbase


def side_thrusts(
    sigma: Elementwise,
    motion_resistance: Elementwise,
    lateral_resistance: Elementwise,
    left_load: Elementwise,
    right_load: Elementwise,
    weight: Elementwise,
    wheelbase: Elementwise,
    track_width: Elementwise,
) -> tuple[Elementwise, Elementwise]:
    """Thrusts (left, right) [N] of a left turn: f_r F_z + σ M_r/B inside, f_r F_z + M_r/B outside.

    A negative inner thrust brakes. Source: Slip (25), (26).

    Args:
        sigma: +1 turning on the spot, −1 in any other turn.
    """
    turning = 0.5 * lateral_resistance * weight * wheelbase / track_width
    left = motion_resistance * left_load + sigma * turning
    return left, motion_resistance * right_load + turning


def lateral_resistance_on_the_spot(
    left_thrust: Elementwise,
    right_thrust: Elementwise,
    motion_resistance: Elementwise,
    left_load: Elementwise,
    right_load: Elementwise,
    weight: Elementwise,
    wheelbase: Elementwise,
    track_width: Elementwise,
) -> Elementwise:
    """Lateral resistance μ_t [1] from the thrusts of turning on the spot (σ = +1).

    μ_t = (B/L)(F_R + F_L − f_r (F_zL + F_zR))/W, the sum of (25) and (26); on level ground the
    loads sum to W and this is the print. Not valid in other turns: the moment cancels in the sum.
    Source: Slip (27).

    Args:
        left_thrust: F_L, magnitude [N].
        right_thrust: F_R, magnitude [N].
    """
    rolling = motion_resistance * (left_load + right_load)
    return track_width / wheelbase * (right_thrust + left_thrust - rolling) / weight


def lateral_resistance_in_a_turn(
    left_thrust: Elementwise,
    right_thrust: Elementwise,
    motion_resistance: Elementwise,
    left_load: Elementwise,
    right_load: Elementwise,
    weight: Elementwise,
    wheelbase: Elementwise,
    track_width: Elementwise,
) -> Elementwise:
    """Lateral resistance μ_t [1] from the thrusts of a left turn not on the spot (σ = −1).

    μ_t = (B/L)(F_R − F_L − f_r (F_zR − F_zL))/W, the difference of (26) and (25). Print gives one
    formula, the sum, for both kinds of turn; here the sum would give 0 on any ground.
    Source: Slip (27), corrected.

    Args:
        left_thrust: F_L, signed, negative if the inner side brakes [N].
        right_thrust: F_R [N].
    """
    rolling = motion_resistance * (right_load - left_load)
    return track_width / wheelbase * (right_thrust - left_thrust - rolling) / weight


def equivalent_drag_ratio(
    curvature: Elementwise, lateral_resistance: Elementwise, wheelbase: Elementwise
) -> Elementwise:
    """Drag of turning as a share of the weight, μ_t L |κ| / 2 [1].

    The turn takes the power M_r |ω| = M_r v |κ| from the body, as the drag M_r |κ| would.
    Omits: longitudinal slip, by which motors have to give B_s/B times as much for turning.
    Source: Slip (24).

    Args:
        curvature: κ [1/m], either sign.
    """
    return 0.5 * lateral_resistance * wheelbase * np.fabs(curvature)
