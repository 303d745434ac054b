"""Standing still on a slope: brakes and friction hold the vehicle, up, down and across.

A stop that ends where the brakes do not hold has not ended: the vehicle rolls back or on. The
brakes hold with their force at standstill, F_b(0), uphill as downhill; the ground holds with
friction on the whole slope, of which grade and roll are the parts.

Validity: brakes that keep their force at rest, dry friction that does not creep. Omits: motion
resistance beyond what F_b holds of it, and a wheel that carries less than its share.

Source: neither paper; free body of a vehicle at rest, loads as in Slip (18)–(21).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise


def brakes_hold(force_ratio: Elementwise, grade: Elementwise) -> Elementwise:
    """F_b(0)/W − |sin θ| [1]: the brakes hold where it is not negative.

    Args:
        force_ratio: F_b/W at standstill [1].
        grade: θ [rad].
    """
    return force_ratio - np.fabs(np.sin(grade))


def friction_holds(friction: Elementwise, grade: Elementwise, roll: Elementwise) -> Elementwise:
    """μ cos θ cos φ − √(sin² θ + sin² φ cos² θ) [1]: the ground holds where it is not negative.

    Args:
        friction: μ [1].
        grade: θ [rad]. roll: φ [rad].
    """
    along, across = np.sin(grade), np.sin(roll) * np.cos(grade)
    return friction * np.cos(grade) * np.cos(roll) - np.sqrt(along * along + across * across)
