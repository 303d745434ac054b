"""The hull of what was driven, in the plainest form."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import Matrix


def highest_speed(corners: Matrix, grade: Floats) -> Floats:
    """(n,) highest speed driven on grades (n,) [rad]; beyond the last corners theirs [m/s]."""
    table = np.array(corners)
    speed: Floats = np.interp(grade, table[:, 0], table[:, 1])
    return speed
