"""Slip track: the width a skid-steered vehicle seems to have when its wheels slip in a turn.

Arguments: rim speeds v_left and v_right of the sides and speed V_x of the body, not of the wheels
[m/s]; yaw_rate ω_z, counter-clockwise positive, not 0 where it divides [rad/s]; slip_track B_s [m].

Validity: steady turning on one kind of ground. Omits: the difference between the slip of the two
sides, and dependence on speed. Source: Slip (1)–(3).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise


def slip_track(v_right: Elementwise, v_left: Elementwise, yaw_rate: Elementwise) -> Elementwise:
    """Slip track B_s = (V_R − V_L)/ω_z [m], at least the track width. Source: Slip (3)."""
    return (v_right - v_left) / yaw_rate


def rotation_centres(
    v_left: Elementwise, v_right: Elementwise, speed: Elementwise, yaw_rate: Elementwise
) -> tuple[Elementwise, Elementwise]:
    """Positions (left, right) y_ICR [m] of the sides' centres of rotation, y to the left.

    Where the wheels of a side touch, the body moves with V_x − ω_z y along the vehicle; this is the
    y at which that is the rim speed, y = (V_x − V_side)/ω_z. Left minus right is B_s of Slip (3);
    sides that slip unlike lie unevenly about the middle. Validity: a speed measured apart from the
    wheels. Source: Slip (1), (2), signs corrected: print has V_x,L − V_x, the negative of its (3).
    """
    return (speed - v_left) / yaw_rate, (speed - v_right) / yaw_rate


def outer_wheel_speed_ratio(curvature: Elementwise, slip_track: Elementwise) -> Elementwise:
    """Rim speed of the outer wheels over the speed of the body, 1 + |κ| B_s/2 [1].

    Source: Slip (3) with ω_z = κ v.

    Args:
        curvature: κ [1/m], either sign.
    """
    return 1.0 + 0.5 * np.fabs(curvature) * slip_track
