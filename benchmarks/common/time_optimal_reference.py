"""Offline optimum of the time-optimal problem by CasADi and IPOPT.

A program over the speeds at the stations with exactly the discrete constraints of
:mod:`slopewise.planner.profile.problems`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.profile import reference
from slopewise.planner.profile.problems import ProfileProblem
from slopewise.planner.profile.reference import FREE, Reference, idle_segments, symbols

_OF_ALL = ("start_sq", "decel", "specific_power")
"""Fields without a number for each station."""


def with_columns(
    problem: ProfileProblem, change: Callable[[Floats], Floats], start_sq: Floats
) -> ProfileProblem:
    """A problem with other stations or candidates, from the same start or another."""
    given = {n: v for n, v in problem._asdict().items() if n not in _OF_ALL and v is not None}
    columns = {name: np.ascontiguousarray(change(np.asarray(v))) for name, v in given.items()}
    return ProfileProblem(**(problem._asdict() | columns | {"start_sq": start_sq}))


def problem_of_one(batch: ProfileProblem, candidate: int, count: int) -> ProfileProblem:
    """The problem of one candidate, (N,) where a batch has (N, M): its first ``count`` stations."""
    start_sq = batch.start_sq[candidate : candidate + 1]
    return with_columns(batch, lambda values: values[:count, candidate], start_sq)


class TimeOptimalReference:
    """The time-optimal program for a number of stations."""

    def __init__(self, stations: int, *, max_iterations: int = 500) -> None:
        """Build it for N ≥ 2 stations; IPOPT gives up after ``max_iterations``."""
        self._solver = _time_optimal_solver(stations, max_iterations)

    def solve(self, problem: ProfileProblem) -> Reference:
        """Solve one candidate, (N,); it begins as fast as start and constraints allow."""
        bound = np.maximum(problem.speed_sq_max, 0.0)
        bound[0] = min(bound[0], float(problem.start_sq[0]))
        ds = np.diff(problem.station)
        braking = problem.lower_intercept + problem.sin_grade
        idle = idle_segments(bound)
        parameters = {
            "ds": ds,
            "moving": np.where(idle, 0.0, 1.0),
            "accel": np.minimum(problem.accel_max[:-1], problem.accel_max[1:]),
            "hold": GRAVITY * np.maximum(problem.demand[:-1], problem.demand[1:]),
            "slope": np.minimum(problem.lower_slope[:-1], problem.lower_slope[1:]),
            "intercept": np.minimum(braking[:-1], braking[1:]),
            "slowest": problem.slowest[:-1],
            "decel": np.full(len(ds), min(problem.decel, 1e6)),
            "power": np.full(len(ds), GRAVITY * problem.specific_power),
        }
        upper = np.tile(np.where(idle, FREE, 0.0), 4)
        return reference.solve_program(self._solver, problem.station, bound, parameters, upper)


def _time_optimal_solver(stations: int, max_iterations: int) -> Any:
    v = ca.SX.sym("v", stations)
    names = ("ds", "moving", "accel", "hold", "slope", "intercept", "slowest", "decel", "power")
    p = symbols(stations - 1, *names)
    before, after = v[:-1], v[1:]
    gained = (after**2 - before**2) / (2.0 * p["ds"])
    # Force that grows with speed is least at the slower end, else at the faster one.
    growing, falling = ca.fmax(p["slope"], 0.0), ca.fmin(p["slope"], 0.0)
    force = p["intercept"] + growing * ca.fmax(after, p["slowest"])
    force += falling * ca.fmax(before, p["slowest"])
    # Holding speed is always possible.
    powered = ca.fmax(p["power"] / ca.fmax(after, 1e-3) - p["hold"], 0.0)
    constraints = ca.vertcat(
        gained - p["accel"], gained - powered, -gained - p["decel"], -gained - GRAVITY * force
    )
    return reference.program_of(v, p, constraints, max_iterations)
