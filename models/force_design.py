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


def corner_design(speed_range: tuple[float, float], grade_range: tuple[float, float]) -> Floats:
    """(4, 4) rows at the corners of a rectangle of speeds [m/s] and grades [rad].

    The force is bilinear in both: a bound at the corners is one everywhere in it.
    """
    speed, grade = np.meshgrid(speed_range, grade_range)
    return design(speed.ravel(), grade.ravel())
