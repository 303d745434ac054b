"""Jerk-limited profile: the fastest one whose acceleration changes no faster than the limit.

The fastest profile is, within hundredths of a percent, the one nearest to the time-optimal profile
from below, which is a quadratic program. Its one nonlinear constraint, the time in which the
acceleration changes, stands there as its tangent (see
:mod:`slopewise.planner.profile.smoothing_program`): the program's set lies inside the exact one, so
what it returns may be driven. An interior-point method along the stations solves it; where that
fails OSQP is asked, unless the failure itself proves that there is nothing to find. Either can be
asked first by a setting, as can IPOPT, which solves the exact program. An answer depends on nothing
that was solved before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.profile.banded_nearest import keeps_none, nearest, room
from slopewise.planner.profile.osqp_nearest import nearest_by_osqp
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.smoothing_program import FEWEST, REST, TIGHTER, program, reachable
from slopewise.planner.settings import Solver

_Numbers = tuple[Floats, Floats, Floats, Floats, float, float]
"""Of a problem: its attributes in their order, NaN for an acceleration that does not matter."""

_LINEARISATIONS = 4
"""Programs per smoothing at most [1]: the second is needed by one problem in sixteen."""

_WORTH = 0.05
"""Share of the distance to the time-optimal profile for which tangents are taken anew."""

_NO_PROFILE = 0
"""In place of iterations: it is proven that no profile keeps the tangents' limits."""


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
    answer = np.zeros(len(top))
    last = len(top) - 1 - int((top[::-1] > REST).argmax())
    if not top[last] > REST:
        return Smoothed(answer, 0)
    # Of the stations of rest at the end only the first takes part.
    part = _first_stations(problem, last + 2)
    used = 0
    orders: dict[str, tuple[Callable[..., int], ...]] = {
        "interior_point": (_along_stations, _by_osqp),
        "osqp": (_by_osqp, _along_stations),
        "ipopt": (_by_ipopt, _along_stations, _by_osqp),
    }
    for solver in orders[first]:
        speed_sq = np.empty(len(part[1]))
        iterations = solver(*part, speed_sq)
        used += abs(iterations)
        if iterations > 0:
            _inside(speed_sq, top, answer)
            return Smoothed(answer, used)
        if iterations == _NO_PROFILE:
            return Smoothed(None, used, "no profile keeps the jerk limit")
    return Smoothed(None, used, f"no profile keeps the jerk limit ({used} iterations)")


@kernel
def _inside(speed_sq: Floats, top: Floats, out: Floats) -> None:
    """Solvers keep limits to their tolerance; the first station is given, at rest is at rest."""
    for k in range(min(speed_sq.shape[0], top.shape[0])):
        within = min(max(speed_sq[k], 0.0), top[k])
        out[k] = within if top[k] > REST else 0.0
    out[0] = top[0] if top[0] > REST else 0.0


def _first_stations(problem: SmoothingProblem, count: int) -> _Numbers:
    """The problem of so many stations; with stations of rest behind them where it has too few."""
    n = min(count, len(problem.speed_sq_max))
    more = max(FEWEST - n, 0)
    parts = [a[: n - 1] for a in (problem.ds, problem.accel_max, problem.decel_max)]
    ds, accel, decel = (np.pad(a, (0, more), constant_values=1.0) if more else a for a in parts)
    top = problem.speed_sq_max[:n]
    top = np.pad(top, (0, more)) if more else top
    before = np.nan if problem.start_accel is None else problem.start_accel
    return ds, top, accel, decel, problem.jerk, before


@kernel
def _along_stations(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    speed_sq: Floats,
) -> int:
    """The answer of the interior-point method; its iterations, negative if it finds none, and
    ``_NO_PROFILE`` if there surely is none.

    Far below the profile of the tangents these give time away. What more exact ones allow is
    weighed by the multipliers: where that is much, they are taken anew at the answer.
    """
    n = top.shape[0]
    x, force = np.empty(n), np.empty((0, n))
    around = reachable(ds, top, jerk, start_accel)
    used = 0
    for turn in range(_LINEARISATIONS):
        fixed, rows, limit = program(ds, top, accel_max, decel_max, jerk, start_accel, around)
        if turn == 0:
            force = np.empty(limit.shape)
        else:
            missed = 0.0
            for k in range(n):
                missed += (speed_sq[k] - top[k]) ** 2
            if room(rows, limit, force, speed_sq) <= _WORTH * 0.5 * missed:
                break
        iterations = nearest(top, fixed, rows, limit, x, force)
        used += abs(iterations)
        if iterations < 0:
            if turn > 0:
                return used
            return _NO_PROFILE if keeps_none(top, fixed, rows, limit, force) else -used
        for k in range(n):
            speed_sq[k] = x[k]
            around[k] = min(max(x[k], 0.0), top[k])
    return used


def _by_osqp(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    speed_sq: Floats,
) -> int:
    """The same by OSQP, with the first tangents."""
    around = reachable(ds, top, jerk, start_accel)
    fixed, rows, limit = program(ds, top, accel_max, decel_max, jerk, start_accel, around)
    return nearest_by_osqp(top, fixed, rows, limit, speed_sq, np.empty(limit.shape))


def _by_ipopt(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    speed_sq: Floats,
) -> int:
    """The exact program by CasADi and IPOPT, tightened as the others are; much slower."""
    from slopewise.planner.profile.reference import jerk_limited_of_any_length

    before = None if np.isnan(start_accel) else start_accel
    accel, decel = (np.maximum(most - TIGHTER, 0.0) for most in (accel_max, decel_max))
    problem = SmoothingProblem(ds, top, accel, decel, jerk * (1.0 - TIGHTER), before)
    found = jerk_limited_of_any_length(problem)
    used = max(found.iterations, 1)
    if found.speed_sq is None:
        return -used
    speed_sq[:] = found.speed_sq
    return used
