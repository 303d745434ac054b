"""Which corners of the trained rectangle no stop was near: there the coefficients extrapolate.

Stops fill a region of speeds and grades, often a slanted one: slow downhill, fast on the level. The
model file states a rectangle around it. Its corners outside the hull of what was driven are named;
the covariance of the coefficients, which plans take at their quantile, grows there by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from models.arrays import Floats
from models.calibration.force_fit import ForceFit

_NEAR = 0.25  # of both ranges: so far beyond the hull still counts as driven


class Corner(NamedTuple):
    """A corner that no stop was near: speed [m/s], grade [rad], F_b/W there and its deviation."""

    speed: float
    grade: float
    force: float
    std: float


def extrapolated_corners(speed: Floats, grade: Floats, fit: ForceFit) -> tuple[Corner, ...]:
    """Corners outside the hull of stops at these speeds (n,) [m/s] and grades (n,) [rad].

    Stops along one line have no hull: then all corners are outside.
    """
    low, span = _range(speed), _range(grade)
    v = (speed - low[0]) / max(low[1] - low[0], 1e-9)
    theta = (grade - span[0]) / max(span[1] - span[0], 1e-9)
    faces = None
    try:
        faces = ConvexHull(np.column_stack((v, theta))).equations
    except (QhullError, ValueError):
        faces = None
    found = []
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        beyond = 1.0 if faces is None else float(np.max(faces[:, :2] @ (i, j) + faces[:, 2]))
        if beyond > _NEAR:
            here = np.array([low[i]]), np.array([span[j]])
            force, std = float(fit.force_ratio(*here)[0]), float(fit.force_std(*here)[0])
            found.append(Corner(low[i], span[j], force, std))
    return tuple(found)


def _range(values: Floats) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))
