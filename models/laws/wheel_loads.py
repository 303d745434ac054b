"""Normal loads of axles, sides and wheels on tilted ground under acceleration.

Quasi-static rigid body on a locally plane ground: gravity and inertia act at the centre of gravity,
normal and tangential forces at the contact points. Gravity in the body frame is
W (−sin θ, −cos θ sin φ, −cos θ cos φ) with grade θ = −pitch and roll φ, so the roll takes weight
off all wheels through cos φ and moves weight from the higher to the lower side through sin φ.

A share is a load divided by the load of the same axle or side standing level: 1 at rest on level
ground, 0 when the wheels lift. A negative share is beyond lifting and says only that.

Arguments: grade θ, uphill positive, and roll φ, left side up positive [rad]; deceleration a_x,
positive while slowing, and lateral_accel a_y in the body frame, positive in a left turn [m/s²];
wheelbase L, track_width B, centre of gravity cg_x ahead of the rear axle and cg_z high [m].

Validity: all wheels on the ground. Omits: suspension travel, the moment of aerodynamic forces,
angular acceleration, and that the centre of gravity moves with the load.

Source: Braking (3)–(5), signs corrected and (4) exchanged; Slip (14)–(21), sign of (21) corrected.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY


def front_load_share(
    grade: Elementwise,
    roll: Elementwise,
    deceleration: Elementwise,
    wheelbase: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
) -> Elementwise:
    """Load of the front axle as a share of its level static load.

    W_f L = cg_x W cos θ cos φ + cg_z W (a_x/g − sin θ), divided by the static load W cg_x/L.
    Downhill and braking load the front. Source: Braking (5), slope term corrected (print has
    + x_cg sin θ instead of − z_cg sin θ); (4), which print gives for the other axle.
    """
    moment = cg_x * np.cos(grade) * np.cos(roll) + cg_z * (deceleration / GRAVITY - np.sin(grade))
    return (moment / wheelbase) / (cg_x / wheelbase)


def rear_load_share(
    grade: Elementwise,
    roll: Elementwise,
    deceleration: Elementwise,
    wheelbase: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
) -> Elementwise:
    """Load of the rear axle as a share of its level static load.

    W_r L = (L − cg_x) W cos θ cos φ − cg_z W (a_x/g − sin θ), divided by W (L − cg_x)/L.
    Downhill and braking unload the rear. NaN where cg_x > L: there is no such rear axle.
    Source: Braking (3), sign of its sin θ term corrected, and (5), (4) as in
    :func:`front_load_share`.
    """
    behind = (wheelbase - cg_x) * np.sqrt(np.sign(wheelbase - cg_x))
    moment = behind * np.cos(grade) * np.cos(roll) - cg_z * (deceleration / GRAVITY - np.sin(grade))
    return moment / behind


def left_load_share(
    grade: Elementwise,
    roll: Elementwise,
    lateral_accel: Elementwise,
    track_width: Elementwise,
    cg_z: Elementwise,
) -> Elementwise:
    """Load of the left side as a share of its level static load W/2.

    cos φ cos θ − 2 (cg_z/B)(cos θ sin φ + a_y/g): a left turn and a raised left side unload it.
    Source: Slip (18) + (19), with the lateral inertia added.
    """
    transfer = np.cos(grade) * np.sin(roll) + lateral_accel / GRAVITY
    return np.cos(roll) * np.cos(grade) - 2.0 * cg_z / track_width * transfer


def right_load_share(
    grade: Elementwise,
    roll: Elementwise,
    lateral_accel: Elementwise,
    track_width: Elementwise,
    cg_z: Elementwise,
) -> Elementwise:
    """Load of the right side as a share of its level static load W/2.

    cos φ cos θ + 2 (cg_z/B)(cos θ sin φ + a_y/g), the mirror of :func:`left_load_share`.
    Source: Slip (20) + (21), sign of (21) corrected, with the lateral inertia added.
    """
    transfer = np.cos(grade) * np.sin(roll) + lateral_accel / GRAVITY
    return np.cos(roll) * np.cos(grade) + 2.0 * cg_z / track_width * transfer


def wheel_loads(
    weight: Elementwise,
    pitch: Elementwise,
    roll: Elementwise,
    accel_x: Elementwise,
    accel_y: Elementwise,
    wheelbase: Elementwise,
    track_width: Elementwise,
    cg_x: Elementwise,
    cg_z: Elementwise,
) -> tuple[Elementwise, Elementwise, Elementwise, Elementwise]:
    """Normal loads [N] of the wheels: 1 front-left, 2 rear-left, 3 front-right, 4 rear-right.

    At rest with cg_x = L/2 these are Slip (18)–(21). Print gives wheel 4 the roll sign of the left
    side; its four loads then do not sum to W cos φ cos θ. Four wheels on a rigid body are
    statically indeterminate by one: the lateral transfer is divided between the axles as the level
    static load is, cg_x/L to the front (the print's even split at cg_x = L/2). Axle sums equal
    :func:`front_load_share` and :func:`rear_load_share`, side sums the lateral shares.

    Args:
        weight: W [N].
        pitch: REP-103 pitch [rad], nose down positive, = −grade.
        accel_x: body acceleration forward [m/s²], negative while braking.
        accel_y: body acceleration to the left [m/s²].
    """
    ahead = cg_x / wheelbase
    normal = np.cos(roll) * np.cos(pitch)
    to_front = cg_z / wheelbase * (np.sin(pitch) - accel_x / GRAVITY)
    to_right = cg_z / track_width * (np.cos(pitch) * np.sin(roll) + accel_y / GRAVITY)
    front = 0.5 * (ahead * normal + to_front)
    rear = 0.5 * ((1.0 - ahead) * normal - to_front)
    return (
        weight * (front - ahead * to_right),
        weight * (rear - (1.0 - ahead) * to_right),
        weight * (front + ahead * to_right),
        weight * (rear + (1.0 - ahead) * to_right),
    )
