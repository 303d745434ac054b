"""Trained range: which corners of the trained rectangle no stop was near, and the hull of stops.

Stops fill a region of speeds and grades, often a slanted one: slow downhill, fast on the level. The
model file states a rectangle around it. Its corners outside the hull of what was driven are named.
Where such a corner is a fast one, the hull is written as well: plans are no faster on a grade than
it. Inside of it the covariance of the coefficients, which plans take at their quantile, speaks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import ForceFit
from slopewise.models.quantity import Matrix

_NEAR = 0.25  # of both ranges: so far beyond the hull still counts as driven
_COUNTS = 0.1  # of both ranges: so far around a stop counts as driven
_MAX_CORNERS = 8  # corners of the hull that are written


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
    low, span = ((float(np.min(c)), float(np.max(c))) for c in (speed, grade))
    v = (speed - low[0]) / max(low[1] - low[0], 1e-9)
    theta = (grade - span[0]) / max(span[1] - span[0], 1e-9)
    try:
        faces = ConvexHull(np.column_stack((v, theta))).equations
    except (QhullError, ValueError):
        faces = None
    missing = []
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        beyond = 1.0 if faces is None else float(np.max(faces[:, :2] @ (i, j) + faces[:, 2]))
        if beyond > _NEAR:
            here = np.array([low[i]]), np.array([span[j]])
            force, std = float(fit.force_ratio(*here)[0]), float(fit.force_std(*here)[0])
            missing.append(Corner(low[i], span[j], force, std))
    return tuple(missing)


def speed_by_grade(
    speed: Floats,
    grade: Floats,
    speed_range: tuple[float, float],
    grade_range: tuple[float, float],
    corners: tuple[Corner, ...],
) -> Matrix | None:
    """Highest speeds driven, by grade: corners (grade [rad], speed [m/s]), concave.

    A stop counts for a tenth of both ranges around it. Of the hull's corners those that matter
    least are omitted, which makes it smaller.

    Args:
        speed, grade: (n,) of stops [m/s], [rad]. speed_range, grade_range: those trained.
        corners: those of the rectangle that no stop was near.

    Returns:
        None where every fast corner was driven.
    """
    middle = 0.5 * sum(speed_range)
    if not any(corner.speed > middle for corner in corners):
        return None
    reach = _COUNTS * (grade_range[1] - grade_range[0])
    fast = np.minimum(speed + _COUNTS * (speed_range[1] - speed_range[0]), speed_range[1])
    ends = np.concatenate((grade - reach, grade + reach))
    points = np.column_stack((np.clip(ends, *grade_range), np.concatenate((fast, fast))))
    chain = _upper_chain(points)
    # The ends of the ranges are the ends of the hull, so that there is no gap between them.
    chain[0], chain[-1] = (grade_range[0], chain[0][1]), (grade_range[1], chain[-1][1])
    while len(chain) > _MAX_CORNERS:
        lost = [abs(_turn(*chain[i : i + 3])) for i in range(len(chain) - 2)]  # twice the area
        del chain[1 + int(np.argmin(lost))]
    return tuple((float(theta), float(v)) for theta, v in _upper_chain(np.array(chain)))


def _upper_chain(points: Floats) -> list[tuple[float, float]]:
    """Upper side of the convex hull of points (n, 2), by the first coordinate (Andrew 1979)."""
    highest: dict[float, float] = {}
    for x, y in points.tolist():
        highest[x] = max(y, highest.get(x, y))
    chain: list[tuple[float, float]] = []
    for point in sorted(highest.items()):
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) >= 0.0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
