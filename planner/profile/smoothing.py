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
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.profile.osqp_nearest import nearest_by_osqp
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.settings import Solver

_Numbers = tuple[Floats, Floats, Floats, Floats, float, float]
"""Of a problem: its attributes in their order, NaN for an acceleration that does not matter."""


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


def smooth(problem: SmoothingProblem, first: Solver = "interior_point") -> Smoothed:
    """Solve one candidate of N stations; that there is no answer is told, not raised.

    Args:
        problem: of the candidate.
        first: who is asked first; where it fails, the others are, IPOPT only if it is the first.
    """
    top = problem.speed_sq_max
    last = len(top) - 1 - int((top[::-1] > core.STANDSTILL_SQ).argmax())
    if not top[last] > core.STANDSTILL_SQ:
        return Smoothed(np.zeros(len(top)), 0)
    # Of the stations of rest at the end only the first takes part.
    part = _first_stations(problem, last + 2)
    used = 0
    orders: dict[str, tuple[Callable[..., tuple[int, Floats]], ...]] = {
        "interior_point": (core.smooth, _by_osqp),
        "osqp": (_by_osqp, core.smooth),
        "ipopt": (_by_ipopt, core.smooth, _by_osqp),
    }
    for solver in orders[first]:
        iterations, speed_sq = solver(*part)
        used += abs(iterations)
        if iterations > 0:
            return Smoothed(core.keep_inside(speed_sq, top), used)
        if iterations == core.NO_PROFILE:
            return Smoothed(None, used, "no profile keeps the jerk limit")
    return Smoothed(None, used, f"no profile keeps the jerk limit ({used} iterations)")


def _first_stations(problem: SmoothingProblem, count: int) -> _Numbers:
    """The problem of so many stations; with stations of rest behind them where it has too few."""
    n = min(count, len(problem.speed_sq_max))
    more = max(core.MIN_STATIONS - n, 0)
    parts = [a[: n - 1] for a in (problem.ds, problem.accel_max, problem.decel_max)]
    ds, accel, decel = (np.pad(a, (0, more), constant_values=1.0) if more else a for a in parts)
    top = problem.speed_sq_max[:n]
    top = np.pad(top, (0, more)) if more else top
    before = np.nan if problem.start_accel is None else problem.start_accel
    return ds, top, accel, decel, problem.jerk, before


def _by_osqp(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
) -> tuple[int, Floats]:
    """As core.smooth by OSQP, with the first tangents."""
    is_open, rows, limit = core.smoothing_program(ds, top, accel_max, decel_max, jerk, start_accel)
    return nearest_by_osqp(top, is_open == 0.0, rows, limit)


def _by_ipopt(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
) -> tuple[int, Floats]:
    """The exact program by CasADi and IPOPT, tightened as the others are; much slower."""
    from slopewise.planner.profile.reference import jerk_limited_of_any_length

    before = None if np.isnan(start_accel) else start_accel
    accel, decel = (np.maximum(most - core.TIGHTENING, 0.0) for most in (accel_max, decel_max))
    problem = SmoothingProblem(ds, top, accel, decel, jerk * (1.0 - core.TIGHTENING), before)
    found = jerk_limited_of_any_length(problem)
    used = max(found.iterations, 1)
    return (-used, top) if found.speed_sq is None else (used, found.speed_sq)
