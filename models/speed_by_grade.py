"""The highest speed that was driven on each grade: the hull of what was driven, as plans use it.

Stops fill a region of onset speeds and grades, often a slanted one: slow downhill, fast on the
level. Between its points the covariance of the coefficients speaks; beyond it they extrapolate. The
hull is given by corners (grade, speed) with speeds that are concave over the grade, so that it is
the least of a few straight lines. Below it slower speeds count as driven.
"""

from __future__ import annotations

import numpy as np

from models.arrays import Floats
from models.errors import ParameterError
from models.quantity import Matrix

MOST_CORNERS = 24
"""Lines that a plan holds each station against."""

_STRAIGHT = 1e-6
"""Change of the slope of neighbouring lines that rounding may make [m/s per rad]."""


def validate(name: str, corners: Matrix | None) -> None:
    """Check corners (grade [rad], speed [m/s]); None passes.

    Raises:
        ParameterError: names the field and what was expected.
    """
    if corners is None:
        return
    if not 2 <= len(corners) <= MOST_CORNERS or any(len(row) != 2 for row in corners):
        words = f"2 … {MOST_CORNERS} pairs of grade and speed, got {len(corners)} rows"
        raise ParameterError(name, words)
    table = np.array(corners)
    if not np.isfinite(table).all() or np.any(table[:, 1] < 0.0):
        raise ParameterError(name, "finite grades and speeds >= 0")
    if np.any(np.diff(table[:, 0]) <= 0.0):
        raise ParameterError(name, "grades that increase from pair to pair")
    slopes = np.diff(table[:, 1]) / np.diff(table[:, 0])
    if np.any(np.diff(slopes) > _STRAIGHT):
        raise ParameterError(name, "speeds that are concave over the grade, as a hull is")


def lines(corners: Matrix) -> Floats:
    """(K, 2) intercept [m/s] and slope [m/s per rad] of the lines between corners."""
    table = np.array(corners)
    slope = np.diff(table[:, 1]) / np.diff(table[:, 0])
    return np.column_stack((table[:-1, 1] - slope * table[:-1, 0], slope))


def highest_speed(corners: Matrix, grade: Floats) -> Floats:
    """(n,) highest speed driven on grades (n,) [rad]; beyond the last corners theirs [m/s]."""
    table = np.array(corners)
    speed: Floats = np.interp(grade, table[:, 0], table[:, 1])
    return speed
