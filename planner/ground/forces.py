"""Braking force of the surfaces that each station may be on: its lower and its upper bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.planner.ground.grade_between import grade_between
from slopewise.planner.ground.surface_table import (
    B_B,
    B_M,
    DEAD,
    FASTEST,
    LEAST_SIN_ROLL,
    M_B,
    M_M,
    MOST_SIN_ROLL,
    OFFSET,
    SLOWEST,
    STEEPEST_DOWN,
    STEEPEST_UP,
    UP_B_M,
    UP_M_M,
)
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass
from slopewise.planner.kernels.workspace import empty


class Forces(NamedTuple):
    """The first arrays of :class:`slopewise.planner.ground.braking_ground.BrakingGround`, in its
    order.
    """

    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats


class _Around(NamedTuple):
    """Grade of a row, its extremes up to both neighbours [rad], sine of its roll, (M,) each."""

    grade: Floats
    lowest: Floats
    highest: Floats
    sin_roll: Floats


def on_one_surface(grade: Floats, sin_roll: Floats, surface: Floats, margin: float) -> Forces:
    """Bounds of the force on one surface.

    Where it has no kink and does not extrapolate, the upper bound *is* the lower one.

    Args:
        grade, sin_roll: (N, M) [rad], [1].
        surface: (COLUMNS,) of :mod:`slopewise.planner.ground.surface_table`.
        margin: share of the force that counts as uncertain where it extrapolates; < 0: it must not.
    """
    lower_slope, lower_intercept, dead_time, slowest, fastest = empty(5, *grade.shape)
    upper_slope, upper_intercept = lower_slope, lower_intercept
    two = margin > 0.0 or _kinked(surface)
    between = (grade, grade)
    if two:
        between = grade_between(grade)
        upper_slope, upper_intercept = empty(2, *grade.shape)
    dead_time[:], slowest[:], fastest[:] = surface[DEAD], surface[SLOWEST], surface[FASTEST]
    forces = Forces(
        lower_slope,
        lower_intercept,
        upper_slope,
        upper_intercept,
        dead_time,
        slowest,
        fastest,
        np.empty(grade.shape, np.bool_),
        np.full(grade.shape[1], surface[OFFSET]),
    )
    _forces_on_one_surface(grade, between, sin_roll, surface, margin, two, forces)
    return forces


def on_many_surfaces(
    grade: Floats, sin_roll: Floats, bits: Ints, table: Floats, margin: float
) -> Forces:
    """Bounds of the force over all surfaces that a station may be on.

    Args:
        grade, sin_roll, margin: as in :func:`on_one_surface`.
        bits: (N, M) surfaces that each station may be on.
        table: (S, COLUMNS) of :mod:`slopewise.planner.ground.surface_table`.
    """
    lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest, fastest = (
        np.empty(grade.shape) for _ in range(7)
    )
    trained, distance_offset = np.empty(grade.shape, np.bool_), np.zeros(grade.shape[1])
    forces = Forces(
        lower_slope,
        lower_intercept,
        upper_slope,
        upper_intercept,
        dead_time,
        slowest,
        fastest,
        trained,
        distance_offset,
    )
    rows = np.ascontiguousarray(bits)
    _forces(grade, grade_between(grade), sin_roll, rows, table, margin, forces)
    return forces


@kernel
def _forces_on_one_surface(
    grade: Floats,
    between: tuple[Floats, Floats],
    sin_roll: Floats,
    surface: Floats,
    margin: float,
    two: bool,
    out: Forces,
) -> None:
    """Both bounds, of which the upper one is written only where the two may differ."""
    extra = max(margin, 0.0)
    for k in range(grade.shape[0]):
        around = _Around(grade[k], between[0][k], between[1][k], sin_roll[k])
        if two:
            _force_row(around, surface, extra, 1.0, out.upper_slope[k], out.upper_intercept[k])
        _force_row(around, surface, extra, -1.0, out.lower_slope[k], out.lower_intercept[k])
        _trained_row(around, surface, margin, out.trained[k])


def _kinked(surface: Floats) -> bool:
    """Other slope coefficients uphill: the force bends where the grade changes sign."""
    return bool((surface[UP_M_M] != surface[M_M]) | (surface[UP_B_M] != surface[B_M]))


has_kink = inlined(_kinked)


@row_pass
def _force_row(
    around: _Around, surface: Floats, extra: float, sign: float, slope: Floats, intercept: Floats
) -> None:
    """Lower (sign −1) or upper (+1) bound of the force on one surface.

    Where it extrapolates, also on the way to a neighbour, it counts with an extra share of itself;
    where the grade changes sign on that way, the force on level ground counts as well.
    """
    m_m, b_m, m_b, b_b = surface[M_M], surface[B_M], surface[M_B], surface[B_B]
    up_m_m, up_b_m = surface[UP_M_M], surface[UP_B_M]
    down, up = surface[STEEPEST_DOWN], surface[STEEPEST_UP]
    least_roll, most_roll = surface[LEAST_SIN_ROLL], surface[MOST_SIN_ROLL]
    kink = has_kink(surface)
    grade, lowest, highest = around.grade, around.lowest, around.highest
    sin_roll = around.sin_roll
    for j in range(grade.shape[0]):
        theta = grade[j]
        per_speed = sign * ((up_m_m if theta > 0.0 else m_m) * theta + m_b)
        constant = sign * ((up_b_m if theta > 0.0 else b_m) * theta + b_b)
        bends = kink & (lowest[j] < 0.0) & (highest[j] > 0.0)
        per_speed = max(per_speed, sign * m_b) if bends else per_speed
        constant = max(constant, sign * b_b) if bends else constant
        beyond = (lowest[j] < down) | (highest[j] > up)
        beyond |= (sin_roll[j] < least_roll) | (sin_roll[j] > most_roll)
        share = extra if beyond else 0.0
        slope[j] = sign * (per_speed + share * abs(per_speed))
        intercept[j] = sign * (constant + share * abs(constant))


@row_pass
def _trained_row(around: _Around, surface: Floats, margin: float, trained: Bools) -> None:
    down, up = surface[STEEPEST_DOWN], surface[STEEPEST_UP]
    least_roll, most_roll = surface[LEAST_SIN_ROLL], surface[MOST_SIN_ROLL]
    grade, sin_roll = around.grade, around.sin_roll
    for j in range(grade.shape[0]):
        inside = (grade[j] >= down) & (grade[j] <= up)
        inside &= (sin_roll[j] >= least_roll) & (sin_roll[j] <= most_roll)
        trained[j] = inside | (margin >= 0.0)


@kernel
def _forces(
    grade: Floats,
    between: tuple[Floats, Floats],
    sin_roll: Floats,
    surfaces: Ints,
    table: Floats,
    margin: float,
    out: Forces,
) -> None:
    """Both bounds of the force over all surfaces that a station may be on.

    A stop leads over several, and one speed at its onset counts for all: below the trained range of
    a surface the force is taken on as if it changed down to the slowest trained speed of any, as
    far as that is the safe side.
    """
    stations, candidates = grade.shape
    slowest = table[:, SLOWEST].min()
    for k in range(stations):
        for j in range(candidates):
            theta = grade[k, j]
            steepest_down, steepest_up = between[0][k, j], between[1][k, j]
            bits = surfaces[k, j]
            low_slope, low_intercept = np.inf, np.inf
            high_slope, high_intercept = -np.inf, -np.inf
            dead, offset, fast = 0.0, 0.0, np.inf
            inside = near_inside = True
            for i in range(table.shape[0]):
                if (bits >> i) & 1 == 0:
                    continue
                uphill = theta > 0.0
                m_m = table[i, UP_M_M] if uphill else table[i, M_M]
                b_m = table[i, UP_B_M] if uphill else table[i, B_M]
                slope = m_m * theta + table[i, M_B]
                intercept = b_m * theta + table[i, B_B]
                flat = table[i, SLOWEST] - slowest
                low_slope = min(low_slope, slope)
                low_intercept = min(low_intercept, intercept + min(slope, 0.0) * flat)
                high_slope = max(high_slope, slope)
                high_intercept = max(high_intercept, intercept + max(slope, 0.0) * flat)
                if steepest_down < 0.0 and steepest_up > 0.0 and has_kink(table[i]):
                    slope, intercept = table[i, M_B], table[i, B_B]
                    low_slope = min(low_slope, slope)
                    low_intercept = min(low_intercept, intercept + min(slope, 0.0) * flat)
                    high_slope = max(high_slope, slope)
                    high_intercept = max(high_intercept, intercept + max(slope, 0.0) * flat)
                dead = max(dead, table[i, DEAD])
                offset = max(offset, table[i, OFFSET])
                fast = min(fast, table[i, FASTEST])
                if not table[i, LEAST_SIN_ROLL] <= sin_roll[k, j] <= table[i, MOST_SIN_ROLL]:
                    inside = near_inside = False
                if theta < table[i, STEEPEST_DOWN] or theta > table[i, STEEPEST_UP]:
                    inside = False
                if steepest_down < table[i, STEEPEST_DOWN] or steepest_up > table[i, STEEPEST_UP]:
                    near_inside = False
            if not near_inside and margin >= 0.0:
                low_slope -= margin * abs(low_slope)
                low_intercept -= margin * abs(low_intercept)
                high_slope += margin * abs(high_slope)
                high_intercept += margin * abs(high_intercept)
                inside = True
            out.lower_slope[k, j] = low_slope
            out.lower_intercept[k, j] = low_intercept
            out.upper_slope[k, j] = high_slope
            out.upper_intercept[k, j] = high_intercept
            out.dead_time[k, j] = dead
            out.slowest[k, j] = slowest
            out.fastest[k, j] = fast
            out.trained[k, j] = inside
            if offset > out.distance_offset[j]:
                out.distance_offset[j] = offset
