"""Jerk-limited profile: the fastest one whose acceleration changes no faster than the limit.

The fastest profile is, within hundredths of a percent, the one nearest to the time-optimal profile
from below, which is a quadratic program. Its one nonlinear constraint, the time in which the
acceleration changes, is convex in v² and stands there as its tangent (see
:mod:`planner.symbolic`): the program's set lies inside the exact one, so what it returns may be
driven. OSQP is set up once for a
number of stations, then only updated and warm-started.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import osqp
from scipy import sparse

from planner.compiled import Floats
from planner.symbolic import nearest_exactly, time_model

_TOLERANCE = 1e-4
_TIGHTER = 1.5e-4
"""Constraints are tightened by more than the solver's tolerance, so that they hold exactly."""

_REST = 1e-9
_FREE = 1e6
_STEP = 0.1


@dataclass(frozen=True, slots=True)
class SmoothingProblem:
    """One candidate; N stations, of which only the first ``moving`` are driven.

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
        speed_sq: (N,) v² [m²/s²], None if the solver failed; then ``reason`` says why.
        iterations: OSQP iterations over all quadratic programs.
        reason: empty if solved.
    """

    speed_sq: Floats | None
    iterations: int
    reason: str = ""


class Smoother:
    """OSQP for one number of stations, warm from call to call."""

    def __init__(self, stations: int, *, max_iterations: int = 1500, exact: bool = True) -> None:
        """Set the sparsity up.

        Args:
            stations: N, at least 4.
            max_iterations: of OSQP before it gives up.
            exact: then solve the program once more by an interior-point method.
        """
        self._n = stations
        self._exact = exact
        self._last: tuple[Floats, Floats] | None = None
        rows, n = self._pattern(), stations
        self._a = sparse.csc_matrix(
            (np.ones(len(rows[0])), (rows[0], rows[1])), shape=(n + (n - 1) + 2 * (n - 2), n)
        )
        # Where each entry of the pattern ends up in the csc data.
        order = sparse.csc_matrix((np.arange(1.0, len(rows[0]) + 1), rows), shape=self._a.shape)
        self._slot = order.data.astype(np.int64) - 1
        self._solver = osqp.OSQP()
        count = self._a.shape[0]
        self._solver.setup(
            sparse.eye(n, format="csc"), np.zeros(n), self._a, -np.ones(count), np.ones(count),
            verbose=False, eps_abs=_TOLERANCE, eps_rel=0.0, max_iter=max_iterations,
            check_termination=10, polishing=False, adaptive_rho=True, adaptive_rho_interval=50,
            scaling=0, rho=_STEP,
        )  # fmt: skip

    def _pattern(self) -> tuple[np.ndarray, np.ndarray]:
        n = self._n
        k, m = np.arange(n - 1), np.arange(n - 2)
        speed = (np.arange(n), np.arange(n))
        accel = (np.concatenate((n + k, n + k)), np.concatenate((k, k + 1)))
        first = 2 * n - 1
        jerk_rows = np.concatenate([first + m, first + m, first + m])
        jerk_columns = np.concatenate([m, m + 1, m + 2])
        down = jerk_rows + n - 2
        return (
            np.concatenate((speed[0], accel[0], jerk_rows, down)),
            np.concatenate((speed[1], accel[1], jerk_columns, jerk_columns)),
        )

    def smooth(self, problem: SmoothingProblem, shift: int | None = None) -> Smoothed:
        """Solve one candidate.

        Args:
            problem: bounds and limits.
            shift: stations that the path's start has moved on since this object's last solution of
                the same path; it then starts from there. None starts cold.
        """
        if shift is None or self._last is None:
            around = problem.speed_sq_max
            dual = np.zeros(self._a.shape[0])
            # What it adapted to before must not show in the answer.
            self._solver.update_settings(rho=_STEP)
        else:
            ends = np.cumsum([0, self._n, self._n - 1, self._n - 2, self._n - 2])
            blocks = [self._last[1][i:j] for i, j in pairwise(ends)]
            dual = np.concatenate([_shifted(block, shift) for block in blocks])
            around = np.minimum(_shifted(self._last[0], shift), problem.speed_sq_max)
        self._last = None
        lower, upper = self._linearise(problem, around)
        if np.any(lower > upper):
            return Smoothed(None, 0, "no profile keeps the jerk limit from this start")
        self._solver.warm_start(x=around, y=dual)
        result = self._solver.solve(raise_error=False)
        used = int(result.info.iter)
        top = problem.speed_sq_max
        solved = result.info.status_val == osqp.SolverStatus.OSQP_SOLVED
        answer = np.asarray(result.x) if solved else None
        if answer is None and self._exact:
            # Long stretches at the jerk limit are what first-order methods are worst at.
            answer = nearest_exactly(self._a, lower, upper, top)
        if answer is None:
            return Smoothed(None, used, f"OSQP: {result.info.status} after {used} iterations")
        solution = np.clip(answer, 0.0, top)
        solution[0] = top[0]
        solution[top <= _REST] = 0.0
        if solved:
            self._last = (solution, np.array(result.y))
        return Smoothed(solution, used)

    def _linearise(self, problem: SmoothingProblem, around: Floats) -> tuple[Floats, Floats]:
        """Update the program around a profile; returns its lower and upper limits."""
        n, ds, top = self._n, problem.ds, problem.speed_sq_max
        times = time_model(around, ds)
        # Stations at rest stay there, and nothing is asked of the segments between them.
        rest = top <= _REST
        idle = rest[:-1] & rest[1:]
        touched = idle[:-1] | idle[1:]
        # Fixed stations are put in their place after the solve: leave room for that.
        fixed = rest.copy()
        fixed[0] = True
        half = 0.5 / ds
        accel_margin = _TIGHTER + _TOLERANCE * half * (fixed[:-1] | fixed[1:])
        jerk_margin = accel_margin[:-1] + accel_margin[1:]

        tangent = problem.jerk * times.between_gradient
        allowed = problem.jerk * times.between
        for i in range(3):
            allowed = allowed - tangent[i] * around[i : n - 2 + i]
        before, after = half[:-1], half[1:]
        up = (before - tangent[0], -(before + after) - tangent[1], after - tangent[2])
        down = (-before - tangent[0], before + after - tangent[1], -after - tangent[2])
        data = np.concatenate((np.ones(n), -half, half, *up, *down))
        unlimited = np.full(n - 2, -_FREE)
        decel = np.where(idle, _FREE, problem.decel_max - accel_margin)
        accel = np.where(idle, _FREE, problem.accel_max - accel_margin)
        jerk_limit = np.where(touched, _FREE, allowed - jerk_margin)
        lower = np.concatenate((np.zeros(n), -decel, unlimited, unlimited))
        upper = np.concatenate((np.maximum(top - _TIGHTER, 0.0), accel, jerk_limit, jerk_limit))
        lower[0] = upper[0] = top[0]
        if problem.start_accel is not None and not idle[0]:
            reach = problem.jerk * ds[0] / max(np.sqrt(top[0]), 0.05)
            upper[n] = min(upper[n], problem.start_accel + reach)
            lower[n] = max(lower[n], problem.start_accel - reach)
        self._a.data = data[self._slot]
        self._solver.update(q=-top, l=lower, u=upper, Ax=self._a.data)
        return lower, upper


def _shifted(values: Floats, by: int) -> Floats:
    """Values moved towards the start, the last one repeated."""
    return values[np.minimum(np.arange(len(values)) + by, len(values) - 1)]
