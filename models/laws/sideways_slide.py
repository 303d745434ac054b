"""Locked wheels on a cross slope: the vehicle drifts, and less of its friction slows it.

Locked wheels do not hold sideways. Their friction opposes the velocity as a whole, so the share
along the path shrinks towards standstill.

Source: derived here; Braking Sec. 1.2 and 5.2 name lock-up alone. Validity: all wheels locked, from
one speed on; sideways speed well below that along the path, so not for its last percents.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise

_MIN_SLOWING = 0.03
"""Smallest deceleration over gravity that friction leaves [1]."""

_SLOWEST = 0.01
"""Share of the speed at lock-up below which the drift no longer changes the path [1]."""
_LEVEL = 1e-6
"""Exponent below which the power is taken by its logarithm [1]: the series is exact to rounding."""


def share_along(
    slowed: Elementwise, grade: Elementwise, roll: Elementwise, sliding_friction: Elementwise
) -> Elementwise:
    """Share of the friction of locked wheels that acts along the path [1].

    With r = v_y/v_x, u = v_x/v_i and a = μ_s cos θ cos φ + sin θ, a mass that slides on a plane
    follows dr/d ln u = −(sin φ + r sin θ)/a except terms of r³: r = (sin φ/a) (1 − uᵉ)/e with
    e = −sin θ/a, which is −ln u on level ground. The share is 1/√(1 + r²).

    Args:
        slowed: u, speed as a share of that at which the wheels locked; below 1 % as at 1 % [1].
        grade: θ [rad], uphill positive. roll: φ [rad]. sliding_friction: μ_s [1].
    """
    upright = np.cos(grade) * np.cos(roll)
    slowing = np.maximum(sliding_friction * upright + np.sin(grade), _MIN_SLOWING)
    logarithm = np.log(np.clip(slowed, _SLOWEST, 1.0))
    exponent = -np.sin(grade) / slowing
    slopes = np.abs(exponent) > _LEVEL
    exponent = np.where(slopes, exponent, 1.0)
    grown = np.where(slopes, -np.expm1(exponent * logarithm) / exponent, -logarithm)
    drift = np.sin(roll) / slowing * grown
    share: Elementwise = 1.0 / np.sqrt(1.0 + drift**2)
    return share
