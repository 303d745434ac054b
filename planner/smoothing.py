"""Jerk-limited profile: the fastest one whose acceleration changes no faster than the limit.

The fastest profile is, within hundredths of a percent, the one nearest to the time-optimal profile
from below, which is a quadratic program. Its one nonlinear constraint, the time in which the
acceleration changes, stands there as its tangent (see :mod:`planner.smoothing_program`): the
program's set lies inside the exact one, so what it returns may be driven. An interior-point method
along the stations solves it; where that fails OSQP is asked. An answer depends on nothing that was
solved before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.banded_nearest import nearest, room
from planner.compiled import Floats
from planner.osqp_nearest import nearest_by_osqp
from planner.smoothing_program import FEWEST, MOST_ROWS, REST, lower_to_reach, program

_NearestPoint = Callable[..., int]
"""As :func:`planner.banded_nearest.nearest`."""

_LINEARISATIONS = 4

_WORTH = 0.05
"""Share of the distance to the time-optimal profile for which tangents are taken anew."""


@dataclass(frozen=True, slots=True)
class SmoothingProblem:
    """One candidate; N stations.

    Attributes:
        ds: (N − 1,) segment lengths [m], > 0.
        speed_sq_max: (N,) bound [m²/s²]; the time-optimal profile, above which nothing is feasible.
        accel_max, decel_max: (N − 1,) [m/s²], >= 0, each valid for every v² up to the bound.
        jerk: [m/s³].
        start_accel: acceleration before the first segment [m/s²], None if it does not matter.
    """

    ds: Floats
    speed_sq_max: Floats
    accel_max: Floats
    decel_max: Floats
    jerk: float
    start_accel: float | None = None


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Result of smoothing.

    Attributes:
        speed_sq: (N,) v² [m²/s²], None if no solver found one; then ``reason`` says why.
        iterations: of the solvers.
        reason: empty if solved.
    """

    speed_sq: Floats | None
    iterations: int
    reason: str = ""


def smooth(problem: SmoothingProblem) -> Smoothed:
    """Solve one candidate."""
    moving = problem.speed_sq_max > REST
    answer = np.zeros(len(moving))
    if not moving.any():
        return Smoothed(answer, 0)
    # Of the stations of rest at the end only the first takes part.
    part = _first_stations(problem, int(np.flatnonzero(moving)[-1]) + 2)
    used = 0
    for solver in (nearest, nearest_by_osqp):
        speed_sq, iterations = _solve(part, solver)
        used += iterations
        if speed_sq is not None:
            n = min(len(speed_sq), len(moving))
            np.clip(speed_sq[:n], 0.0, problem.speed_sq_max[:n], out=answer[:n])
            answer[0] = problem.speed_sq_max[0]
            answer[~moving] = 0.0
            return Smoothed(answer, used)
    return Smoothed(None, used, f"no profile keeps the jerk limit ({used} iterations)")


def _first_stations(problem: SmoothingProblem, count: int) -> SmoothingProblem:
    """The problem of so many stations; with stations of rest behind them where it has too few."""
    n = min(count, len(problem.speed_sq_max))
    more = max(FEWEST - n, 0)
    parts = [a[: n - 1] for a in (problem.ds, problem.accel_max, problem.decel_max)]
    ds, accel, decel = (np.pad(a, (0, more), constant_values=1.0) if more else a for a in parts)
    top = problem.speed_sq_max[:n]
    top = np.pad(top, (0, more)) if more else top
    return SmoothingProblem(ds, top, accel, decel, problem.jerk, problem.start_accel)


def _solve(problem: SmoothingProblem, solver: _NearestPoint) -> tuple[Floats | None, int]:
    """The answer of one solver, None if the tangents leave it no way; and its iterations.

    Far below the profile of the tangents these give time away. What more exact ones allow is
    weighed by the multipliers: where that is much, they are taken anew at the answer.
    """
    top = problem.speed_sq_max
    n = len(top)
    fixed, start = np.empty(n, np.bool_), np.empty(n - 1, np.int64)
    rows, limit, force = np.empty((MOST_ROWS * n, 3)), *np.empty((2, MOST_ROWS * n))
    accel = np.nan if problem.start_accel is None else problem.start_accel
    around, x, best, used = top.copy(), np.empty(n), None, 0
    if problem.start_accel is not None and top[0] > REST:
        lower_to_reach(problem.ds, accel, problem.jerk, around)
    for _ in range(_LINEARISATIONS):
        r = program(
            problem.ds, top, problem.accel_max, problem.decel_max, problem.jerk, accel, around,
            fixed, start, rows, limit,
        )  # fmt: skip
        system = start, rows[:r], limit[:r]
        if best is not None:
            gain = room(*system, force[:r], best)
            if gain <= _WORTH * 0.5 * float(np.sum((best - top) ** 2)):
                break
        iterations = solver(top, fixed, *system, x, force[:r])
        used += abs(iterations)
        if iterations < 0:
            break
        best = x.copy()
        around = np.clip(best, 0.0, top)
    return best, used
