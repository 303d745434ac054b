"""The quadratic program of :mod:`slopewise.planner.profile.smoothing` for other solvers.

min ½ xᵀx − topᵀx over A x <= upper, with x the v² at the stations and the time between segments as
its tangent at the time-optimal profile: the planner's own first program, row by row.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from slopewise.models.arrays import Floats
from slopewise.planner.profile.osqp_nearest import matrix_of
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.smoothing_program import program

Solve = Callable[[], Floats | None]


@dataclass(frozen=True, slots=True)
class QuadraticProgram:
    """min ½ xᵀx − topᵀx over A x <= upper and E x = fixed."""

    top: Floats
    quadratic: sparse.csc_matrix
    equations: sparse.csc_matrix
    fixed: Floats
    constraints: sparse.csc_matrix
    upper: Floats

    @property
    def rows(self) -> sparse.csc_matrix:
        """Equations above inequalities."""
        return sparse.vstack((self.equations, self.constraints), format="csc")


def program_of(problem: SmoothingProblem) -> QuadraticProgram:
    """Build the program around the time-optimal profile."""
    top = problem.speed_sq_max
    accel = np.nan if problem.start_accel is None else problem.start_accel
    fixed, rows, limit = program(
        problem.ds, top, problem.accel_max, problem.decel_max, problem.jerk, accel, top
    )
    used = rows.any(axis=1).ravel()
    identity = sparse.eye(len(top), format="csc")
    return QuadraticProgram(
        top,
        identity,
        identity[fixed].tocsc(),
        top[fixed],
        matrix_of(rows)[used].tocsc(),
        limit.ravel()[used],
    )


def osqp(problem: SmoothingProblem) -> Solve:
    """Operator splitting, a first-order method."""
    module = importlib.import_module("osqp")
    p = program_of(problem)
    lower = np.concatenate((p.fixed, np.full(len(p.upper), -np.inf)))
    upper = np.concatenate((p.fixed, p.upper))
    rows = p.rows
    settings = {"verbose": False, "eps_abs": 1e-4, "eps_rel": 0.0, "max_iter": 4000}

    def solve() -> Floats | None:
        solver = module.OSQP()
        solver.setup(p.quadratic, -p.top, rows, lower, upper, **settings)
        result = solver.solve(raise_error=False)
        solved = result.info.status_val == module.SolverStatus.OSQP_SOLVED
        return np.array(result.x) if solved else None

    return solve


def piqp(problem: SmoothingProblem) -> Solve:
    """Proximal interior-point method, sparse."""
    module = importlib.import_module("piqp")
    p = program_of(problem)

    def solve() -> Floats | None:
        solver = module.SparseSolver()
        solver.settings.verbose = False
        solver.setup(
            P=p.quadratic, c=-p.top, A=p.equations, b=p.fixed, G=p.constraints, h_u=p.upper
        )
        return np.array(solver.result.x) if solver.solve() == module.PIQP_SOLVED else None

    return solve


def clarabel(problem: SmoothingProblem) -> Solve:
    """Interior-point method for conic programs."""
    module = importlib.import_module("clarabel")
    p = program_of(problem)
    limits = np.concatenate((p.fixed, p.upper))
    cones = [module.ZeroConeT(len(p.fixed)), module.NonnegativeConeT(len(p.upper))]
    rows, settings = p.rows, module.DefaultSettings()
    settings.verbose = False

    def solve() -> Floats | None:
        solver = module.DefaultSolver(p.quadratic, -p.top, rows, limits, cones, settings)
        solution = solver.solve()
        return np.array(solution.x) if str(solution.status) == "Solved" else None

    return solve
