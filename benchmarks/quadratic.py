"""The quadratic program of :mod:`planner.smoothing` for other solvers than OSQP.

min ½ xᵀx − topᵀx over lower <= A x <= upper, with x the v² at the stations and the time between
segments as its tangent; one program, without the warm start and the margins of the planner.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from planner.compiled import Bools, Floats
from planner.smoothing import SmoothingProblem
from planner.symbolic import time_model

_REST = 1e-9
_FREE = 1e6


@dataclass(frozen=True, slots=True)
class QuadraticProgram:
    """min ½ xᵀx − topᵀx over lower <= A x <= upper."""

    top: Floats
    constraints: sparse.csc_matrix
    lower: Floats
    upper: Floats

    @property
    def fixed(self) -> Bools:
        """Rows that leave no freedom: interior-point methods want them as equations."""
        fixed: Bools = self.lower == self.upper
        return fixed


def program_of(problem: SmoothingProblem) -> QuadraticProgram:
    """The program around the time-optimal profile."""
    n, ds, top = len(problem.speed_sq_max), problem.ds, problem.speed_sq_max
    times = time_model(top, ds)
    rest = top <= _REST
    idle = rest[:-1] & rest[1:]
    touched = idle[:-1] | idle[1:]
    half = 0.5 / ds
    gain = sparse.diags([-half, half], [0, 1], shape=(n - 1, n))
    change = sparse.diags([-1.0, 1.0], [0, 1], shape=(n - 2, n - 1)) @ gain
    tangent = problem.jerk * times.between_gradient
    allowed = problem.jerk * times.between
    for i in range(3):
        allowed = allowed - tangent[i] * top[i : n - 2 + i]
    slack = sparse.diags(list(tangent), [0, 1, 2], shape=(n - 2, n))
    constraints = sparse.vstack(
        (sparse.eye(n), gain, change - slack, -change - slack), format="csc"
    )
    accel = np.where(idle, _FREE, problem.accel_max)
    decel = np.where(idle, _FREE, problem.decel_max)
    limit = np.where(touched, _FREE, allowed)
    none = np.full(n - 2, -_FREE)
    lower = np.concatenate((np.zeros(n), -decel, none, none))
    upper = np.concatenate((np.maximum(top, 0.0), accel, limit, limit))
    lower[0] = upper[0]
    return QuadraticProgram(top, constraints, lower, upper)


def piqp(problem: SmoothingProblem) -> Callable[[], Floats | None]:
    """Proximal interior-point method, sparse; set up and solved from ready matrices."""
    module = importlib.import_module("piqp")
    program = program_of(problem)
    fixed = program.fixed
    matrices = {
        "P": sparse.eye(len(program.top), format="csc"), "c": -program.top,
        "A": program.constraints[fixed], "b": program.upper[fixed],
        "G": program.constraints[~fixed],
        "h_l": program.lower[~fixed], "h_u": program.upper[~fixed],
    }  # fmt: skip

    def solve() -> Floats | None:
        solver = module.SparseSolver()
        solver.settings.verbose = False
        solver.setup(**matrices)
        status = solver.solve()
        return np.array(solver.result.x) if status == module.PIQP_SOLVED else None

    return solve


def clarabel(problem: SmoothingProblem) -> Callable[[], Floats | None]:
    """Interior-point method for conic programs; set up and solved from ready matrices."""
    module = importlib.import_module("clarabel")
    program = program_of(problem)
    a, fixed = program.constraints, program.fixed
    above = ~fixed & (program.upper < _FREE)
    below = ~fixed & (program.lower > -_FREE)
    rows = sparse.vstack((a[fixed], a[above], -a[below]), format="csc")
    limits = np.concatenate((program.upper[fixed], program.upper[above], -program.lower[below]))
    cones = [
        module.ZeroConeT(int(fixed.sum())),
        module.NonnegativeConeT(int(above.sum() + below.sum())),
    ]
    quadratic = sparse.eye(len(program.top), format="csc")
    settings = module.DefaultSettings()
    settings.verbose = False

    def solve() -> Floats | None:
        solver = module.DefaultSolver(quadratic, -program.top, rows, limits, cones, settings)
        solution = solver.solve()
        return np.array(solution.x) if str(solution.status) == "Solved" else None

    return solve
