"""Jerk-limited profile: the fastest one whose acceleration changes no faster than the limit.

The fastest profile is, within hundredths of a percent, the one nearest to the time-optimal profile
from below, which is a quadratic program. Its one nonlinear constraint, the time in which the
acceleration changes, stands there as its tangent (see `core/profile/smoothing.hpp`): the program's
set lies inside the exact one, so the answer may be driven. An interior-point method along the
stations solves it; where that fails OSQP is asked, unless the failure itself proves that there is
nothing to find. Either can be asked first by a setting, as can IPOPT, which solves the exact
program. An answer depends on nothing that was solved before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.profile.osqp_nearest import nearest_by_osqp
from slopewise.planner.profile.problems import SmoothingProblem
from slopewise.planner.settings import Solver


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Result of smoothing.

    Attributes:
        speed_sq: (N,) v² [m²/s²], None if no solver found one; then ``reason`` says why.
        iterations: number over all solvers [1].
        reason: empty if solved.
    """

    speed_sq: Floats | None
    iterations: int
    reason: str = ""


def smooth(problem: SmoothingProblem, first: Solver = "interior_point") -> Smoothed:
    """Solve one candidate of N stations; a missing answer is reported, not raised.

    Args:
        problem: one candidate's.
        first: solver to try first; where it fails, the others follow, without IPOPT.
    """
    top = problem.speed_sq_max
    last = len(top) - 1 - int((top[::-1] > core.STANDSTILL_SQ).argmax())
    if not top[last] > core.STANDSTILL_SQ:
        return Smoothed(np.zeros(len(top)), 0)
    # Of the stations of rest at the end only the first takes part.
    part = _first_stations(problem, last + 2)
    used = 0
    orders: dict[str, tuple[Callable[[SmoothingProblem], tuple[int, Floats]], ...]] = {
        "interior_point": (core.smooth, _by_osqp),
        "osqp": (_by_osqp, core.smooth),
        "ipopt": (_by_ipopt, core.smooth, _by_osqp),
    }
    for solver in orders[first]:
        iterations, speed_sq = solver(part)
        used += abs(iterations)
        if iterations > 0:
            return Smoothed(core.keep_inside(speed_sq, top), used)
        if iterations == core.NO_PROFILE:
            return Smoothed(None, used, "no profile keeps the jerk limit")
    return Smoothed(None, used, f"no profile keeps the jerk limit ({used} iterations)")


def _first_stations(problem: SmoothingProblem, count: int) -> SmoothingProblem:
    """The problem with that number of stations, at rest behind its last where it has too few."""
    n = min(count, len(problem.speed_sq_max))
    more = max(core.MIN_STATIONS - n, 0)
    parts = [a[: n - 1] for a in (problem.ds, problem.accel_max, problem.decel_max)]
    ds, accel, decel = (np.pad(a, (0, more), constant_values=1.0) if more else a for a in parts)
    top = problem.speed_sq_max[:n]
    top = np.pad(top, (0, more)) if more else top
    return SmoothingProblem(ds, top, accel, decel, problem.jerk, problem.start_accel)


def _by_osqp(problem: SmoothingProblem) -> tuple[int, Floats]:
    """As core.smooth by OSQP, with the first tangents."""
    is_open, rows, limit = core.smoothing_program(problem)
    return nearest_by_osqp(problem.speed_sq_max, is_open == 0.0, rows, limit)


def _by_ipopt(problem: SmoothingProblem) -> tuple[int, Floats]:
    """The exact program by CasADi and IPOPT, tightened as the others are; much slower."""
    from slopewise.planner.profile.reference import jerk_limited_of_any_length

    accel, decel = (
        np.maximum(limit - core.TIGHTENING, 0.0) for limit in (problem.accel_max, problem.decel_max)
    )
    jerk = problem.jerk * (1.0 - core.TIGHTENING)
    tight = replace(problem, accel_max=accel, decel_max=decel, jerk=jerk)
    solved = jerk_limited_of_any_length(tight)
    used = max(solved.iterations, 1)
    return (-used, problem.speed_sq_max) if solved.speed_sq is None else (used, solved.speed_sq)
