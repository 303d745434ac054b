"""Braking force of the surfaces that each station may be on: the weakest and the strongest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planner.ground.surface_table import (
    B_B,
    B_M,
    DEAD,
    FASTEST,
    M_B,
    M_M,
    OFFSET,
    SLOWEST,
    STEEPEST_DOWN,
    STEEPEST_UP,
    UP_B_M,
    UP_M_M,
)
from planner.kernels.compiled import Bools, Floats, Ints, inlined, kernel, row_pass
from planner.kernels.workspace import empty


class Forces(NamedTuple):
    """The first arrays of :class:`planner.ground.braking_ground.BrakingGround`, in its order."""

    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats


def on_one_surface(grade: Floats, surface: Floats, margin: float) -> Forces:
    """Where it has no kink and does not extrapolate, the stronger force *is* the weaker one."""
    lower_slope, lower_intercept, dead_time, slowest, fastest = empty(5, *grade.shape)
    upper_slope, upper_intercept = lower_slope, lower_intercept
    two = margin > 0.0 or has_kink(surface)
    if two:
        upper_slope, upper_intercept = empty(2, *grade.shape)
    trained = np.empty(grade.shape, np.bool_)
    _forces_on_one_surface(
        grade,
        surface,
        margin,
        two,
        upper_slope,
        upper_intercept,
        lower_slope,
        lower_intercept,
        trained,
    )
    dead_time[:], slowest[:], fastest[:] = surface[DEAD], surface[SLOWEST], surface[FASTEST]
    offset = np.full(grade.shape[1], surface[OFFSET])
    return Forces(
        lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest, fastest,
        trained, offset,
    )  # fmt: skip


def on_many_surfaces(grade: Floats, bits: Ints, table: Floats, margin: float) -> Forces:
    lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest, fastest = (
        np.empty(grade.shape) for _ in range(7)
    )
    trained, distance_offset = np.empty(grade.shape, np.bool_), np.zeros(grade.shape[1])
    forces = Forces(
        lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest, fastest,
        trained, distance_offset,
    )  # fmt: skip
    _forces(grade, bits, table, margin, *forces)
    return forces


@kernel
def _forces_on_one_surface(
    grade: Floats, surface: Floats, margin: float, two: bool, upper_slope: Floats,
    upper_intercept: Floats, lower_slope: Floats, lower_intercept: Floats, trained: Bools,
) -> None:  # fmt: skip
    """Both forces, of which the stronger one is written only where the two may differ."""
    extra = max(margin, 0.0)
    for k in range(grade.shape[0]):
        before, after = grade[max(k - 1, 0)], grade[min(k + 1, grade.shape[0] - 1)]
        if two:
            _force_row(
                grade[k], before, after, surface, extra, 1.0, upper_slope[k], upper_intercept[k]
            )
        _force_row(
            grade[k], before, after, surface, extra, -1.0, lower_slope[k], lower_intercept[k]
        )
        _trained_row(grade[k], surface, margin, trained[k])


@inlined
def has_kink(surface: Floats) -> bool:
    """Other slope coefficients uphill: the force bends where the grade changes sign."""
    return bool((surface[UP_M_M] != surface[M_M]) | (surface[UP_B_M] != surface[B_M]))


@row_pass
def _force_row(
    grade: Floats, before: Floats, after: Floats, surface: Floats, extra: float, sign: float,
    speed_part: Floats, intercept_part: Floats,
) -> None:  # fmt: skip
    """Weaker (sign −1) or stronger (+1) force of one surface.

    Where it extrapolates, also to a neighbour, it counts with an extra share of itself; where the
    grade changes sign on the way to a neighbour, the force on level ground counts as well.
    """
    m_m, b_m, m_b, b_b = surface[M_M], surface[B_M], surface[M_B], surface[B_B]
    up_m_m, up_b_m = surface[UP_M_M], surface[UP_B_M]
    down, up = surface[STEEPEST_DOWN], surface[STEEPEST_UP]
    kink = has_kink(surface)
    for j in range(grade.shape[0]):
        theta = grade[j]
        speed = sign * ((up_m_m if theta > 0.0 else m_m) * theta + m_b)
        rest = sign * ((up_b_m if theta > 0.0 else b_m) * theta + b_b)
        steepest_down = min(theta, min(before[j], after[j]))
        steepest_up = max(theta, max(before[j], after[j]))
        bends = kink & (steepest_down < 0.0) & (steepest_up > 0.0)
        speed = max(speed, sign * m_b) if bends else speed
        rest = max(rest, sign * b_b) if bends else rest
        share = extra if (steepest_down < down) | (steepest_up > up) else 0.0
        speed_part[j] = sign * (speed + share * abs(speed))
        intercept_part[j] = sign * (rest + share * abs(rest))


@row_pass
def _trained_row(grade: Floats, surface: Floats, margin: float, trained: Bools) -> None:
    down, up = surface[STEEPEST_DOWN], surface[STEEPEST_UP]
    for j in range(grade.shape[0]):
        trained[j] = ((grade[j] >= down) & (grade[j] <= up)) | (margin >= 0.0)


@kernel
def _forces(
    grade: Floats, surfaces: Ints, table: Floats, margin: float,
    lower_slope: Floats, lower_intercept: Floats, upper_slope: Floats, upper_intercept: Floats,
    dead_time: Floats, slowest: Floats, fastest: Floats, trained: Bools, distance_offset: Floats,
) -> None:  # fmt: skip
    stations, candidates = grade.shape
    for k in range(stations):
        for j in range(candidates):
            theta = grade[k, j]
            before, after = grade[max(k - 1, 0), j], grade[min(k + 1, stations - 1), j]
            steepest_down = min(theta, min(before, after))
            steepest_up = max(theta, max(before, after))
            bits = surfaces[k, j]
            low_speed, low_intercept = np.inf, np.inf
            high_speed, high_intercept = -np.inf, -np.inf
            dead, offset, fast = 0.0, 0.0, np.inf
            least_slow, most_slow = np.inf, 0.0
            inside, near_inside = True, True
            for i in range(table.shape[0]):
                if (bits >> i) & 1 == 0:
                    continue
                uphill = theta > 0.0
                m_m = table[i, UP_M_M] if uphill else table[i, M_M]
                b_m = table[i, UP_B_M] if uphill else table[i, B_M]
                speed_part = m_m * theta + table[i, M_B]
                intercept_part = b_m * theta + table[i, B_B]
                low_speed = min(low_speed, speed_part)
                low_intercept = min(low_intercept, intercept_part)
                high_speed = max(high_speed, speed_part)
                high_intercept = max(high_intercept, intercept_part)
                if steepest_down < 0.0 and steepest_up > 0.0 and has_kink(table[i]):
                    low_speed = min(low_speed, table[i, M_B])
                    low_intercept = min(low_intercept, table[i, B_B])
                    high_speed = max(high_speed, table[i, M_B])
                    high_intercept = max(high_intercept, table[i, B_B])
                dead = max(dead, table[i, DEAD])
                offset = max(offset, table[i, OFFSET])
                least_slow = min(least_slow, table[i, SLOWEST])
                most_slow = max(most_slow, table[i, SLOWEST])
                fast = min(fast, table[i, FASTEST])
                if theta < table[i, STEEPEST_DOWN] or theta > table[i, STEEPEST_UP]:
                    inside = False
                if steepest_down < table[i, STEEPEST_DOWN] or steepest_up > table[i, STEEPEST_UP]:
                    near_inside = False
            if not near_inside and margin >= 0.0:
                low_speed -= margin * abs(low_speed)
                low_intercept -= margin * abs(low_intercept)
                high_speed += margin * abs(high_speed)
                high_intercept += margin * abs(high_intercept)
                inside = True
            lower_slope[k, j] = low_speed
            lower_intercept[k, j] = low_intercept
            upper_slope[k, j] = high_speed
            upper_intercept[k, j] = high_intercept
            dead_time[k, j] = dead
            slowest[k, j] = least_slow if low_speed > 0.0 else most_slow
            fastest[k, j] = fast
            trained[k, j] = inside
            if offset > distance_offset[j]:
                distance_offset[j] = offset
