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

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.profile.osqp_nearest import matrix_of
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.smoothing_program import program


@dataclass(frozen=True, slots=True)
class QuadraticProgram:
    """min ½ xᵀx − topᵀx over A x <= upper, where ``fixed`` stations are as in top."""

    top: Floats
    fixed: Bools
    constraints: sparse.csc_matrix
    upper: Floats

    @property
    def quadratic(self) -> sparse.csc_matrix:
        """The quadratic term."""
        return sparse.eye(len(self.top), format="csc")

    @property
    def equations(self) -> sparse.csc_matrix:
        """Rows that pick the fixed stations."""
        return self.quadratic[self.fixed].tocsc()


def program_of(problem: SmoothingProblem) -> QuadraticProgram:
    """The program around the time-optimal profile."""
    top = problem.speed_sq_max
    accel = np.nan if problem.start_accel is None else problem.start_accel
    fixed, rows, limit = program(
        problem.ds, top, problem.accel_max, problem.decel_max, problem.jerk, accel, top
    )
    there = rows.any(axis=1).ravel()
    return QuadraticProgram(top, fixed, matrix_of(rows)[there].tocsc(), limit.ravel()[there])


def osqp(problem: SmoothingProblem) -> Callable[[], Floats | None]:
    """Operator splitting, a first-order method; set up and solved from ready matrices."""
    module = importlib.import_module("osqp")
    program = program_of(problem)
    rows = sparse.vstack((program.equations, program.constraints), format="csc")
    held = program.top[program.fixed]
    lower = np.concatenate((held, np.full(len(program.upper), -np.inf)))
    upper = np.concatenate((held, program.upper))

    def solve() -> Floats | None:
        solver = module.OSQP()
        solver.setup(
            program.quadratic,
            -program.top,
            rows,
            lower,
            upper,
            verbose=False,
            eps_abs=1e-4,
            eps_rel=0.0,
            max_iter=4000,
        )
        result = solver.solve(raise_error=False)
        solved = result.info.status_val == module.SolverStatus.OSQP_SOLVED
        return np.array(result.x) if solved else None

    return solve


def piqp(problem: SmoothingProblem) -> Callable[[], Floats | None]:
    """Proximal interior-point method, sparse; set up and solved from ready matrices."""
    module = importlib.import_module("piqp")
    program = program_of(problem)
    matrices = {
        "P": program.quadratic,
        "c": -program.top,
        "A": program.equations,
        "b": program.top[program.fixed],
        "G": program.constraints,
        "h_u": program.upper,
    }

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
    rows = sparse.vstack((program.equations, program.constraints), format="csc")
    limits = np.concatenate((program.top[program.fixed], program.upper))
    cones = [
        module.ZeroConeT(int(program.fixed.sum())),
        module.NonnegativeConeT(len(program.upper)),
    ]
    settings = module.DefaultSettings()
    settings.verbose = False

    def solve() -> Floats | None:
        solver = module.DefaultSolver(
            program.quadratic, -program.top, rows, limits, cones, settings
        )
        solution = solver.solve()
        return np.array(solution.x) if str(solution.status) == "Solved" else None

    return solve
