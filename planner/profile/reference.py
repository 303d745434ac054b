"""Offline optimum by CasADi and IPOPT, to compare the fast planner with.

A program over the speeds at the stations, which minimises travel time with v² linear between
stations under the exact constraints that :mod:`slopewise.planner.profile.smoothing` replaces by
tangents. It is built once for a number of stations and solved for any candidate of that length. It
takes milliseconds to seconds and may stop at a local optimum: for tests, benchmarks, and plans that
have the time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.profile.problems import SmoothingProblem

_SLOWEST_GUESS = 0.05
"""Where the solver may start at the slowest [m/s]: at rest the time has no derivative."""

FREE = np.inf

_STATIONS_MORE = 32
"""Cached programs are for multiples of this number of stations."""

_ONE_AT_A_TIME = Lock()
"""A solver of CasADi has one memory."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Answer of IPOPT.

    Attributes:
        speed_sq: (N,) v² [m²/s²]; None if it failed, and ``reason`` says why.
        travel_time: until the last movement ends [s]; NaN if it failed.
        iterations: of IPOPT.
        reason: empty if solved.
    """

    speed_sq: Floats | None
    travel_time: float
    iterations: int
    reason: str = ""


class JerkLimitedReference:
    """The jerk-limited program for a number of stations."""

    def __init__(self, stations: int, *, max_iterations: int = 500) -> None:
        """Build it.

        Args:
            stations: N, at least 3.
            max_iterations: of IPOPT before it gives up.
        """
        v = ca.SX.sym("v", stations)
        p = symbols(stations - 1, "ds", "moving", "accel", "decel")
        p |= symbols(stations - 2, "jerk")
        gained = (v[1:] ** 2 - v[:-1] ** 2) / (2.0 * p["ds"])
        times = times_of(v, p)
        allowed = p["jerk"] * 0.5 * (times[:-1] + times[1:])
        change = gained[1:] - gained[:-1]
        constraints = ca.vertcat(
            gained - p["accel"], -gained - p["decel"], change - allowed, -change - allowed
        )
        self._solver = program_of(v, p, constraints, max_iterations)

    def solve(self, problem: SmoothingProblem) -> Reference:
        """Solve one candidate; its first station keeps its speed, as when smoothing."""
        bound = np.where(problem.speed_sq_max <= core.STANDSTILL_SQ, 0.0, problem.speed_sq_max)
        idle = idle_segments(bound)
        accel, decel = problem.accel_max.copy(), problem.decel_max.copy()
        if problem.start_accel is not None and not idle[0]:
            reach = problem.jerk * problem.ds[0] / max(np.sqrt(bound[0]), 0.05)
            accel[0] = min(accel[0], problem.start_accel + reach)
            decel[0] = min(decel[0], reach - problem.start_accel)
        parameters = {
            "ds": problem.ds,
            "moving": np.where(idle, 0.0, 1.0),
            "accel": accel,
            "decel": decel,
            "jerk": np.full(len(idle) - 1, problem.jerk),
        }
        on_segments = np.where(idle, FREE, 0.0)
        between = np.where(idle[:-1] | idle[1:], FREE, 0.0)
        upper = np.concatenate((on_segments, on_segments, between, between))
        station = np.concatenate(([0.0], np.cumsum(problem.ds)))
        return solve_program(self._solver, station, bound, parameters, upper, fixed_start=True)


def jerk_limited_of_any_length(problem: SmoothingProblem) -> Reference:
    """The jerk-limited optimum of a candidate, by a program kept for the next of about its length.

    Stations of rest fill the candidate up; several threads wait for one another.
    """
    n = len(problem.speed_sq_max)
    more = -n % _STATIONS_MORE
    ds, accel, decel = (
        np.pad(a, (0, more), constant_values=1.0)
        for a in (problem.ds, problem.accel_max, problem.decel_max)
    )
    filled = replace(
        problem,
        ds=ds,
        accel_max=accel,
        decel_max=decel,
        speed_sq_max=np.pad(problem.speed_sq_max, (0, more)),
    )
    with _ONE_AT_A_TIME:
        solved = _program(n + more).solve(filled)
    return solved if solved.speed_sq is None else replace(solved, speed_sq=solved.speed_sq[:n])


@lru_cache(maxsize=8)
def _program(stations: int) -> JerkLimitedReference:
    return JerkLimitedReference(stations)


def symbols(size: int, *names: str) -> dict[str, Any]:
    return {name: ca.SX.sym(name, size) for name in names}


def times_of(speed: Any, parameters: Mapping[str, Any]) -> Any:
    """Time on each segment, 0 where nothing moves."""
    moving = parameters["moving"]
    return 2.0 * moving * parameters["ds"] / (speed[:-1] + speed[1:] + (1.0 - moving))


def program_of(
    speed: Any, parameters: Mapping[str, Any], constraints: Any, max_iterations: int
) -> Any:
    """A solver that takes speeds and the parameters, in their order."""
    program = {
        "x": speed,
        "p": ca.vertcat(*parameters.values()),
        "f": ca.sum1(times_of(speed, parameters)),
        "g": constraints,
    }
    options: dict[str, Any] = {
        "print_time": False,
        "error_on_fail": False,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "max_iter": max_iterations,
            "bound_relax_factor": 0,
        },
    }
    return ca.nlpsol("reference", "ipopt", program, options)


def idle_segments(bound: Floats) -> Bools:
    """Segments on which nothing may move, (N − 1,)."""
    rest = bound <= core.STANDSTILL_SQ
    idle: Bools = rest[:-1] & rest[1:]
    return idle


def solve_program(
    solver: Any,
    station: Floats,
    bound: Floats,
    parameters: Mapping[str, Floats],
    upper: Floats,
    *,
    fixed_start: bool = False,
) -> Reference:
    """Solve for v up to √bound with constraints up to ``upper``."""
    fastest = np.sqrt(bound)
    slowest = np.zeros_like(fastest)
    if fixed_start:
        slowest[0] = fastest[0]
    guess = np.clip(0.8 * fastest, np.minimum(_SLOWEST_GUESS, fastest), fastest)
    result = solver(
        x0=guess,
        p=np.concatenate(list(parameters.values())),
        lbx=slowest,
        ubx=fastest,
        lbg=-FREE,
        ubg=upper,
    )
    stats = solver.stats()
    iterations = int(stats["iter_count"])
    if not stats["success"]:
        return Reference(None, float("nan"), iterations, f"IPOPT: {stats['return_status']}")
    speed_sq = np.clip(np.asarray(result["x"]).ravel(), 0.0, fastest) ** 2
    return Reference(speed_sq, float(core.motion(station, speed_sq)[1][-1]), iterations)
