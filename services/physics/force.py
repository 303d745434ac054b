"""Force of the brakes on one surface, F_b/W = (m_m v + b_m) θ + (m_b v + b_b).

v is the speed at which the brakes take hold, θ the grade, uphill positive, with coefficients of
their own uphill. Source: Braking (7), (8).
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Braking

NO_FRICTION_LIMIT = 1e6
"""Friction of surfaces whose wheels do not lock: above any force over weight [1]."""


def applied_share(table: Braking) -> float:
    """Share of the full force at an application, linear from dead band to saturation."""
    share = (table.level - table.dead_band) / (table.saturation - table.dead_band)
    return min(max(share, 0.0), 1.0)


def force_line(
    downhill: tuple[float, float],
    uphill: tuple[float, float],
    level: tuple[float, float],
    grade: Floats,
) -> tuple[Floats, Floats]:
    """Slope [s/m] and intercept [1] of F_b/W over v on grades of any shape [rad].

    ``downhill``, ``uphill``: (m_m, b_m) [s/m], [1]; ``level``: (m_b, b_b) [s/m], [1].
    """
    rises = grade > 0.0
    slope, intercept = (
        np.where(rises, up, down) * grade + flat
        for down, up, flat in zip(downhill, uphill, level, strict=True)
    )
    return slope, intercept
