"""Motion resistance: what rolling costs, learned from motor currents.

Arguments: coefficient motion_resistance f_r [1]; current I of a side's motor and idle_current with
the wheels lifted [A]; torque_constant k_t [N m/A]; gear_ratio τ, motor turns a wheel turn [1];
wheel_radius r [m]; side_load F_z, normal load of the side, > 0 [N].

Validity: straight driving at constant speed; a brushed motor, torque proportional to current.
Omits: dependence on speed, losses of the gear under load, and gravity: on a grade the motors also
hold W sin θ. Source: Slip (12), (13).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise


def motion_resistance(
    current: Elementwise,
    idle_current: Elementwise,
    torque_constant: Elementwise,
    gear_ratio: Elementwise,
    wheel_radius: Elementwise,
    side_load: Elementwise,
) -> Elementwise:
    """Coefficient of motion resistance f_r = τ k_t (I − I_idle) / (r F_z) [1] of one side.

    One motor drives the wheels of a side, so F_z is the load of that side. The print has no idle
    current: its I₀ is the mean current on straights; with ``idle_current`` 0 this is the print's.
    NaN where the side is pulled, not pressed: wheels in the air roll on nothing.
    Source: Slip (12), (13).
    """
    torque = gear_ratio * torque_constant * (current - idle_current)
    return torque / (wheel_radius * side_load * np.sqrt(np.sign(side_load)))
