"""Over a crest the ground falls away under the vehicle: wheels press less, and brakes hold less.

On ground of vertical curvature κ_v = dθ/ds, θ the grade uphill positive and s along the ground, a
vehicle at speed v falls with −v² κ_v, so its normal load is W cos θ + m v² κ_v. Taken at the centre
of gravity, the loss unloads every axle by the same share of its level static load.

Arguments: speed v [m/s]; vertical_curvature κ_v [1/m].

Validity: wheels that keep touching the ground; grade and its change as seen over the wheelbase.
Only the loss is a law here: in a hollow wheels press more, which no plan may count on. Omits: the
suspension, which gives a part of it back on crests shorter than the vehicle.

Source: free body; Braking (3), (5) are for even slopes. Measured in a physics engine: −12° of grade
within 3 m at 4 m/s took 13 % of the load and made stops up to 10 % longer.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY

_EPSILON = 1e-300
"""Keeps 0/0 from NaN; below any curvature [1/m]."""


def load_loss(speed: Elementwise, vertical_curvature: Elementwise) -> Elementwise:
    """Share of the weight that no longer presses on the ground, max(0, −κ_v) v²/g; NaN of NaN."""
    falling = 0.5 * (np.fabs(vertical_curvature) - vertical_curvature)
    return speed * speed * falling / GRAVITY


def remaining_force(
    speed: Elementwise, vertical_curvature: Elementwise, share: Elementwise
) -> Elementwise:
    """Share of F_b that remains over a crest, max(0, 1 − k load loss); NaN of NaN.

    Args:
        share: k, how much of the lost load the force loses; 1 if friction decides.
    """
    falling = 0.5 * (np.fabs(vertical_curvature) - vertical_curvature)
    remaining = 1.0 - share * (speed * speed * falling / GRAVITY)
    return 0.5 * (remaining + np.fabs(remaining))


def crest_speed_sq(
    min_share_without_crest: Elementwise, min_share: Elementwise, vertical_curvature: Elementwise
) -> Elementwise:
    """Highest v² over a crest at which every axle, side and wheel keeps its share [m²/s²].

    v² = g (share − least)/(−κ_v): with nothing to keep, g cos θ cos φ/|κ_v|, where the vehicle
    would fly. Huge where the ground does not fall away, 0 where nothing can be lost; NaN of NaN.

    Args:
        min_share_without_crest: smallest share of the level static load that any of them
            has without the crest [1].
        min_share: share that each must keep [1].
    """
    over = min_share_without_crest - min_share
    spare = 0.5 * (over + np.fabs(over))
    falling = 0.5 * (np.fabs(vertical_curvature) - vertical_curvature)
    return GRAVITY * spare / (falling + _EPSILON)
