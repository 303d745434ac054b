"""The cheapest possible speed profile: compiled forward–backward passes as a lower bound of time.

Station-major, in tiles that stay in the cache, without branches. Both passes know speed bounds and
limits of acceleration; the second one brakes by the model of
:mod:`slopewise.planner.profile.time_optimal` in its simplest form, with the force of the segment's
first station at the speed of its end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Braking
from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.compiled import TILE, kernel


class BrakingLine(NamedTuple):
    """Coefficients of F_b/W = (m_m v + b_m) θ + m_b v + b_b."""

    m_m: float
    b_m: float
    m_b: float
    b_b: float


@kernel
def plain_pass(
    speed_sq_max: Floats, ds: float, accel: float, decel: float, speed_sq: Floats
) -> None:
    """Apply speed bounds and constant limits of acceleration, from rest.

    Args:
        speed_sq_max: shape (N, M) [m²/s²].
        ds: distance of neighbouring stations [m].
        accel, decel: [m/s²].
        speed_sq: output, shape (N, M) [m²/s²].
    """
    stations, candidates = speed_sq_max.shape
    gain, loss = 2.0 * ds * accel, 2.0 * ds * decel
    for first in range(0, candidates, TILE):
        end = min(first + TILE, candidates)
        for j in range(first, end):
            speed_sq[stations - 1, j] = speed_sq_max[stations - 1, j]
        for k in range(stations - 2, -1, -1):
            for j in range(first, end):
                speed_sq[k, j] = min(speed_sq_max[k, j], speed_sq[k + 1, j] + loss)
        for j in range(first, end):
            speed_sq[0, j] = 0.0
        for k in range(stations - 1):
            for j in range(first, end):
                speed_sq[k + 1, j] = min(speed_sq[k + 1, j], speed_sq[k, j] + gain)


def braking_pass(
    speed_sq_max: Floats,
    station: Floats,
    grade: Floats,
    sin_grade: Floats,
    braking: Braking,
    accel: float,
    decel: float,
    speed_sq: Floats,
) -> None:
    """Apply the bounds as :func:`plain_pass` does, with F_b/W in the backward pass."""
    force = BrakingLine(braking.m_m, braking.b_m, braking.m_b, braking.b_b)
    _braking_pass(speed_sq_max, station, grade, sin_grade, force, accel, decel, speed_sq)


@kernel
def _braking_pass(
    speed_sq_max: Floats,
    station: Floats,
    grade: Floats,
    sin_grade: Floats,
    b: BrakingLine,
    accel: float,
    decel: float,
    speed_sq: Floats,
) -> None:
    stations, candidates = speed_sq_max.shape
    for first in range(0, candidates, TILE):
        end = min(first + TILE, candidates)
        for j in range(first, end):
            speed_sq[stations - 1, j] = speed_sq_max[stations - 1, j]
        for k in range(stations - 2, -1, -1):
            for j in range(first, end):
                twice = 2.0 * (station[k + 1, j] - station[k, j])
                v = np.sqrt(speed_sq[k + 1, j])
                force = (b.m_m * v + b.b_m) * grade[k, j] + b.m_b * v + b.b_b + sin_grade[k, j]
                slowed = speed_sq[k + 1, j] + twice * min(decel, GRAVITY * force)
                speed_sq[k, j] = min(speed_sq_max[k, j], slowed)
        for j in range(first, end):
            speed_sq[0, j] = 0.0
        for k in range(stations - 1):
            for j in range(first, end):
                twice = 2.0 * (station[k + 1, j] - station[k, j])
                speed_sq[k + 1, j] = min(speed_sq[k + 1, j], speed_sq[k, j] + twice * accel)
