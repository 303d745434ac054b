"""Offline optimum of the time-optimal problem by CasADi and IPOPT.

A program over the speeds at the stations with exactly the discrete constraints of
:mod:`slopewise.planner.profile.time_optimal`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.profile.reference import (
    FREE,
    Reference,
    idle_segments,
    program_of,
    solve_program,
    symbols,
)
from slopewise.planner.profile.time_optimal import ProfileProblem


@dataclass(frozen=True, slots=True)
class TimeOptimalProblem:
    """One candidate from :class:`slopewise.planner.profile.time_optimal.ProfileProblem`; arrays
    are (N,).

    Attributes:
        station: [m], increasing.
        speed_sq_max: highest v² [m²/s²].
        sin_grade: sine of the grade.
        lower_slope, lower_intercept: coefficients of the braking force [s/m], [1].
        slowest: below it the force does not change with speed [m/s].
        accel_max: by comfort, thrust and axle load [m/s²].
        demand: share of the weight that holding the speed costs.
        start_sq: highest v² at the first station [m²/s²].
        decel: service deceleration [m/s²].
        specific_power: drive power / weight [m/s].
    """

    station: Floats
    speed_sq_max: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    slowest: Floats
    accel_max: Floats
    demand: Floats
    start_sq: float
    decel: float
    specific_power: float

    def until(self, end: int) -> TimeOptimalProblem:
        """The first ``end`` stations of it."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: v[:end] for k, v in arrays.items() if np.ndim(v) == 1})


def time_optimal_problem(batch: ProfileProblem, candidate: int, count: int) -> TimeOptimalProblem:
    """The problem of one candidate of a batch, its first ``count`` stations."""
    columns = {
        name: np.ascontiguousarray(getattr(batch, name)[:count, candidate])
        for name in ProfileProblem._fields
        if np.ndim(getattr(batch, name)) == 2
    }
    return TimeOptimalProblem(
        **columns,
        start_sq=float(batch.start_sq[candidate]),
        decel=batch.decel,
        specific_power=batch.specific_power,
    )


class TimeOptimalReference:
    """The time-optimal program for a number of stations."""

    def __init__(self, stations: int, *, max_iterations: int = 500) -> None:
        """Build it.

        Args:
            stations: N, at least 2.
            max_iterations: of IPOPT before it gives up.
        """
        self._solver = _time_optimal_solver(stations, max_iterations)

    def solve(self, problem: TimeOptimalProblem) -> Reference:
        """Solve one candidate; the first station is as fast as start and constraints allow."""
        bound = np.maximum(problem.speed_sq_max, 0.0)
        bound[0] = min(bound[0], problem.start_sq)
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
        return solve_program(self._solver, problem.station, bound, parameters, upper)


def _time_optimal_solver(stations: int, max_iterations: int) -> Any:
    v = ca.SX.sym("v", stations)
    p = symbols(
        stations - 1,
        "ds",
        "moving",
        "accel",
        "hold",
        "slope",
        "intercept",
        "slowest",
        "decel",
        "power",
    )
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
    return program_of(v, p, constraints, max_iterations)
