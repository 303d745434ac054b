"""Rows of the regression that the braking law is linear in."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats


def design(speed: Floats, grade: Floats) -> Floats:
    """(n, 4) rows [v θ, θ, v, 1] of onset speeds v [m/s] and grades θ [rad], broadcast to (n,).

    :func:`slopewise.models.laws.braking.force_ratio` is their product with m_m, b_m, m_b, b_b.
    """
    speed, grade = np.broadcast_arrays(speed, grade)
    return np.column_stack((speed * grade, grade, speed, np.ones_like(speed)))
