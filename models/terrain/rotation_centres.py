"""Centres of rotation of both sides of a skid-steered vehicle, not their difference only.

Where the wheels of a side touch, the body moves with V_x − ω_z y along the vehicle; the centre of
rotation of the side is the y at which that is its rim speed. Both lie outside the wheels' centre
lines, the left one at y > 0, and their distance is the slip track. Sides that slip unlike show as
centres that lie unevenly about the middle.

Validity: steady turning in the plane; the speed of the body measured apart from the wheels: the
mean of the rim speeds in its place makes the centres even by construction. Omits: the position
along the vehicle, which the three centres share. Source: Slip (1), (2), signs corrected: print has
V_x,L − V_x, whose difference is the negative of its (3).
"""

from __future__ import annotations

from slopewise.models.arrays import Elementwise


def rotation_centres(
    v_left: Elementwise, v_right: Elementwise, speed: Elementwise, yaw_rate: Elementwise
) -> tuple[Elementwise, Elementwise]:
    """Positions (left, right) y_ICR [m] of the sides' centres of rotation, y to the left.

    y = (V_x − V_side)/ω_z; left minus right is B_s of Slip (3). Source: Slip (1), (2).

    ``speed``: V_x of the body, not of the wheels [m/s]. ``yaw_rate``: ω_z [rad/s], not 0.
    """
    return (speed - v_left) / yaw_rate, (speed - v_right) / yaw_rate
