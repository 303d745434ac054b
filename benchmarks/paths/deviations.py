"""How far two lines are apart, by dense samples alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from slopewise.models.arrays import Floats

_STEP = 0.004  # [m] between samples


def samples(line: Floats) -> Floats:
    """Places on a line (n, 2), no two in a row farther apart than 4 mm."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    distinct = np.concatenate(([True], np.diff(along) > 0.0))
    at = np.unique(np.concatenate((along, np.arange(0.0, along[-1], _STEP))))
    axes = (np.interp(at, along[distinct], line[distinct, axis]) for axis in range(2))
    return np.stack(tuple(axes), axis=1)


def largest_distance(first: Floats, second: Floats) -> float:
    """Largest distance from either line to the nearest place of the other [m]."""
    here, there = samples(first), samples(second)
    away, back = cKDTree(there).query(here)[0], cKDTree(here).query(there)[0]
    return float(max(away.max(), back.max()))
