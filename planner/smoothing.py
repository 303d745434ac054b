"""Jerk-limited profile: the fastest one whose acceleration changes no faster than the limit.

The fastest profile is, within hundredths of a percent, the one nearest to the time-optimal profile
from below, which is a quadratic program. Its one nonlinear constraint, the time in which the
acceleration changes, is convex in v² and stands there as its tangent (see
:mod:`planner.symbolic`): the program's set lies inside the exact one, so what it returns may be
driven. The first answer for a path comes from an interior-point method; from cycle to cycle OSQP,
set up once for a number of stations, is updated and starts from the answer before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import osqp
from scipy import sparse

from planner.compiled import Floats, Ints, kernel
from planner.symbolic import SLOWEST, MidTimes, nearest_exactly

_TOLERANCE = 1e-4
_TIGHTER = 1.5e-4
"""Constraints are tightened by more than the solver's tolerance, so that they hold exactly."""

_REST = 1e-9
_FREE = 1e6
_STEP = 1.0
"""OSQP's ρ, fixed: adapted, it wanders off to where nothing converges any more."""

_STEPS = 3
_EXACT_CALLS = 10
"""Calls that the interior-point method takes over when OSQP did not get there."""

_NEAR = 0.02
"""Share of the highest v² by which a profile may differ from that of its tangents."""

_ROUNDS = 6
"""In which the time for a segment and the speed at its end become one another's."""

_WORTH = 0.05
"""Share of the distance to the time-optimal profile for which tangents are taken anew."""

_Answer = tuple[Floats, Floats]
"""v² and multipliers."""


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

    def __init__(self, stations: int, *, max_iterations: int = 150) -> None:
        """Set the sparsity up.

        Args:
            stations: N, at least 4.
            max_iterations: of OSQP before the interior-point method takes over.
        """
        self.stations = self._n = stations
        self._times = MidTimes(stations)
        self._last: _Answer | None = None
        self._exact_calls = 0
        rows, n = self._pattern(), stations
        self._a = sparse.csc_matrix(
            (np.ones(len(rows[0])), (rows[0], rows[1])), shape=(n + (n - 1) + 2 * (n - 2), n)
        )
        # Where each entry of the pattern ends up in the csc data.
        order = sparse.csc_matrix((np.arange(1.0, len(rows[0]) + 1), rows), shape=self._a.shape)
        self._slot = np.argsort(order.data)
        # Rows of one kind follow one another, station by station.
        kinds = [n, n - 1, n - 2, n - 2]
        self._row = np.arange(sum(kinds))
        self._last_row = np.repeat(np.cumsum(kinds) - 1, kinds)
        self._solver = osqp.OSQP()
        count = self._a.shape[0]
        self._solver.setup(
            sparse.eye(n, format="csc"), np.zeros(n), self._a, -np.ones(count), np.ones(count),
            verbose=False, eps_abs=_TOLERANCE, eps_rel=0.0, max_iter=max_iterations,
            check_termination=10, polishing=False, adaptive_rho=False,
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
                the same path; OSQP then starts from there. None solves by an interior-point
                method, whose answer depends on nothing that was solved before.
        """
        top = problem.speed_sq_max
        answer, used = None, 0
        if shift is not None and self._last is not None and self._exact_calls == 0:
            answer, used = self._warmly(problem, shift)
            # What was slow will be slow in the next cycle as well.
            self._exact_calls = _EXACT_CALLS if answer is None else 0
        elif shift is None:
            self._exact_calls = 0
        else:
            self._exact_calls = max(self._exact_calls - 1, 0)
        if answer is None:
            # The first time, and where a first-order method is slow: long at the jerk limit.
            answer = self._exactly(problem)
        if answer is None:
            self._last = None
            return Smoothed(None, used, f"no profile keeps the jerk limit ({used} iterations)")
        solution = np.clip(answer[0], 0.0, top)
        solution[0] = top[0]
        solution[top <= _REST] = 0.0
        self._last = (solution, answer[1])
        return Smoothed(solution, used)

    def _exactly(self, problem: SmoothingProblem) -> _Answer | None:
        """The interior-point method's answer; None if no tangents leave it a way.

        Far below the profile of the tangents these give time away. What more exact ones allow is
        weighed by the multipliers: where that is much, they are taken anew at the answer.
        """
        top = problem.speed_sq_max
        lower, upper = self._linearise(problem, _reachable(problem))
        answer = None
        if np.all(lower <= upper):
            answer = nearest_exactly(self._a, lower, upper, top)
        if answer is None:
            return None
        jerk = slice(2 * self._n - 1, None)
        for _ in range(_STEPS):
            x, multipliers = answer
            lower, upper = self._linearise(problem, np.clip(x, 0.0, top))
            left = np.clip(upper - self._a @ x, 0.0, _FREE)[jerk]
            gain = float(np.abs(multipliers[jerk]) @ left)
            if gain <= _WORTH * 0.5 * float(np.sum((x - top) ** 2)) or np.any(lower > upper):
                break
            better = nearest_exactly(self._a, lower, upper, top)
            if better is None:
                break
            answer = better
        return answer

    def _warmly(self, problem: SmoothingProblem, shift: int) -> tuple[_Answer | None, int]:
        """OSQP from the last answer, moved on; None if it does not get there, and its iterations.

        Where the answer is far from the profile that the tangents were taken at, they are taken
        anew: a step of sequential quadratic programming.
        """
        assert self._last is not None
        top, used = problem.speed_sq_max, 0
        x, multipliers = self._last
        answer: _Answer = (
            x[np.minimum(np.arange(self._n) + shift, self._n - 1)],
            multipliers[np.minimum(self._row + shift, self._last_row)],
        )
        for _ in range(_STEPS):
            around = np.clip(answer[0], 0.0, top)
            lower, upper = self._linearise(problem, around)
            if np.any(lower > upper):
                return None, used
            self._solver.update(q=-top, l=lower, u=upper, Ax=self._a.data)
            self._solver.warm_start(x=around, y=answer[1])
            result = self._solver.solve(raise_error=False)
            used += int(result.info.iter)
            if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
                return None, used
            answer = np.array(result.x), np.array(result.y)
            if np.max(np.abs(answer[0] - around)) < _NEAR * np.max(top):
                return answer, used
        return None, used

    def _linearise(self, problem: SmoothingProblem, around: Floats) -> tuple[Floats, Floats]:
        """Update the program around a profile; returns its lower and upper limits."""
        times = self._times.around(around, problem.ds)
        accel = np.nan if problem.start_accel is None else problem.start_accel
        lower, upper = np.empty((2, self._a.shape[0]))
        _program(
            problem.ds, problem.speed_sq_max, problem.accel_max, problem.decel_max, problem.jerk,
            accel, around, times.between, times.between_gradient, self._slot,
            self._a.data, lower, upper,
        )  # fmt: skip
        return lower, upper


def _reachable(problem: SmoothingProblem) -> Floats:
    """The time-optimal profile as far as the acceleration before the start lets it be reached."""
    if problem.start_accel is None or problem.speed_sq_max[0] <= _REST:
        return problem.speed_sq_max
    around = problem.speed_sq_max.copy()
    _lower_to_reach(problem.ds, problem.start_accel, problem.jerk, around)
    return around


@kernel
def _lower_to_reach(ds: Floats, accel: float, jerk: float, speed_sq: Floats) -> None:
    """Lower a profile to where the acceleration rises from its first value as fast as it may."""
    before, accel = speed_sq[0], accel + jerk * ds[0] / np.sqrt(speed_sq[0])
    taken = 0.0
    for k in range(ds.shape[0]):
        after, last_taken, last_accel = before, taken, accel
        for _ in range(_ROUNDS):
            taken = 2.0 * ds[k] / (np.sqrt(before) + np.sqrt(after))
            if k > 0:
                accel = last_accel + 0.5 * jerk * (last_taken + taken)
            after = max(before + 2.0 * accel * ds[k], SLOWEST * SLOWEST)
        if after >= speed_sq[k + 1]:
            return
        speed_sq[k + 1] = before = after


@kernel
def _program(
    ds: Floats, top: Floats, accel_max: Floats, decel_max: Floats, jerk: float,
    start_accel: float, around: Floats, between: Floats, gradient: Floats, slot: Ints,
    data: Floats, lower: Floats, upper: Floats,
) -> None:  # fmt: skip
    """Entries and limits of the program, in the order of :meth:`Smoother._pattern`."""
    n = top.shape[0]
    first_accel, first_jerk, rows = n, 2 * n - 1, n - 2
    for k in range(n):
        data[slot[k]] = 1.0
        lower[k], upper[k] = 0.0, max(top[k] - _TIGHTER, 0.0)
    lower[0] = upper[0] = top[0]
    before, margin_before, idle_before = 0.0, 0.0, True
    for k in range(n - 1):
        half = 0.5 / ds[k]
        # Stations at rest stay there, and nothing is asked of the segments between them.
        rests, stays = top[k] <= _REST, top[k + 1] <= _REST
        idle = rests and stays
        # Fixed stations are put in their place after the solve: leave room for that.
        margin = _TIGHTER + (_TOLERANCE * half if k == 0 or rests or stays else 0.0)
        data[slot[n + k]], data[slot[2 * n - 1 + k]] = -half, half
        lower[first_accel + k] = -_FREE if idle else -(decel_max[k] - margin)
        upper[first_accel + k] = _FREE if idle else accel_max[k] - margin
        if k > 0:
            m = k - 1
            up, down = first_jerk + m, first_jerk + rows + m
            lower[up] = lower[down] = -_FREE
            t0, t1, t2 = (
                jerk * gradient[0, m], jerk * gradient[1, m], jerk * gradient[2, m]
            )  # fmt: skip
            allowed = jerk * between[m] - (t0 * around[m] + t1 * around[m + 1] + t2 * around[m + 2])
            free = idle or idle_before
            upper[up] = upper[down] = _FREE if free else allowed - (margin_before + margin)
            entry = 3 * n - 2 + m
            data[slot[entry]] = before - t0
            data[slot[entry + rows]] = -(before + half) - t1
            data[slot[entry + 2 * rows]] = half - t2
            data[slot[entry + 3 * rows]] = -before - t0
            data[slot[entry + 4 * rows]] = before + half - t1
            data[slot[entry + 5 * rows]] = -half - t2
        elif not (np.isnan(start_accel) or idle):
            reach = jerk * ds[0] / max(np.sqrt(top[0]), 0.05)
            upper[n] = min(upper[n], start_accel + reach)
            lower[n] = max(lower[n], start_accel - reach)
        before, margin_before, idle_before = half, margin, idle
