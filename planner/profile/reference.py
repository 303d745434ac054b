"""Offline optimum by CasADi and IPOPT, to hold the fast planner against.

Two programs over the speeds at the stations, both minimising travel time with v² linear between
stations: the time-optimal one has exactly the discrete constraints of
:mod:`slopewise.planner.profile.time_optimal`; the jerk-limited one has the exact constraints that
:mod:`slopewise.planner.profile.smoothing` replaces by tangents. A program is built once for a
number of stations and solved for any candidate of that length. It takes milliseconds to seconds and
may stop at a local optimum: for tests, benchmarks, and plans that have the time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.plan import motion_of
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.time_optimal import ProfileProblem

_STANDSTILL = 1e-9
"""v² up to which a station is at rest [m²/s²]."""

_SLOWEST_GUESS = 0.05
"""Where the solver may start at the slowest [m/s]: at rest the time has no derivative."""

_FREE = np.inf

_STATIONS_MORE = 32
"""Programs that are kept are for multiples of so many stations."""

_ONE_AT_A_TIME = Lock()
"""A solver of CasADi has one memory."""


@dataclass(frozen=True, slots=True)
class TimeOptimalProblem:
    """One candidate out of :class:`slopewise.planner.profile.time_optimal.ProfileProblem`; arrays
    are (N,).

    Attributes:
        station: [m], increasing.
        speed_sq_max: highest v² [m²/s²].
        sin_grade: sine of the grade.
        lower_slope, lower_intercept: of the force that braking may count on [s/m], [1].
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


@dataclass(frozen=True, slots=True)
class Reference:
    """What IPOPT found.

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
        idle = _idle(bound)
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
        upper = np.tile(np.where(idle, _FREE, 0.0), 4)
        return _solve(self._solver, problem.station, bound, parameters, upper)


class JerkLimitedReference:
    """The jerk-limited program for a number of stations."""

    def __init__(self, stations: int, *, max_iterations: int = 500) -> None:
        """Build it.

        Args:
            stations: N, at least 3.
            max_iterations: of IPOPT before it gives up.
        """
        self._solver = _jerk_limited_solver(stations, max_iterations)

    def solve(self, problem: SmoothingProblem) -> Reference:
        """Solve one candidate; its first station keeps its speed, as when smoothing."""
        bound = np.where(problem.speed_sq_max <= _STANDSTILL, 0.0, problem.speed_sq_max)
        idle = _idle(bound)
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
        on_segments = np.where(idle, _FREE, 0.0)
        between = np.where(idle[:-1] | idle[1:], _FREE, 0.0)
        upper = np.concatenate((on_segments, on_segments, between, between))
        station = np.concatenate(([0.0], np.cumsum(problem.ds)))
        return _solve(self._solver, station, bound, parameters, upper, fixed_start=True)


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
        found = _kept_program(n + more).solve(filled)
    return found if found.speed_sq is None else replace(found, speed_sq=found.speed_sq[:n])


@lru_cache(maxsize=8)
def _kept_program(stations: int) -> JerkLimitedReference:
    return JerkLimitedReference(stations)


def _time_optimal_solver(stations: int, max_iterations: int) -> Any:
    v = ca.SX.sym("v", stations)
    p = _symbols(
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
    return _nlp(v, p, constraints, max_iterations)


def _jerk_limited_solver(stations: int, max_iterations: int) -> Any:
    v = ca.SX.sym("v", stations)
    p = _symbols(stations - 1, "ds", "moving", "accel", "decel")
    p |= _symbols(stations - 2, "jerk")
    gained = (v[1:] ** 2 - v[:-1] ** 2) / (2.0 * p["ds"])
    times = _times(v, p)
    allowed = p["jerk"] * 0.5 * (times[:-1] + times[1:])
    change = gained[1:] - gained[:-1]
    constraints = ca.vertcat(
        gained - p["accel"], -gained - p["decel"], change - allowed, -change - allowed
    )
    return _nlp(v, p, constraints, max_iterations)


def _symbols(size: int, *names: str) -> dict[str, Any]:
    return {name: ca.SX.sym(name, size) for name in names}


def _times(v: Any, p: Mapping[str, Any]) -> Any:
    """Time on each segment, 0 where nothing moves."""
    return 2.0 * p["moving"] * p["ds"] / (v[:-1] + v[1:] + (1.0 - p["moving"]))


def _nlp(v: Any, p: Mapping[str, Any], constraints: Any, max_iterations: int) -> Any:
    """A solver that takes speeds v and the parameters p, in their order."""
    program = {"x": v, "p": ca.vertcat(*p.values()), "f": ca.sum1(_times(v, p)), "g": constraints}
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


def _idle(bound: Floats) -> Bools:
    """Segments on which nothing may move, (N − 1,)."""
    rest = bound <= _STANDSTILL
    idle: Bools = rest[:-1] & rest[1:]
    return idle


def _solve(
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
        lbg=-_FREE,
        ubg=upper,
    )
    stats = solver.stats()
    iterations = int(stats["iter_count"])
    if not stats["success"]:
        return Reference(None, float("nan"), iterations, f"IPOPT: {stats['return_status']}")
    speed_sq = np.clip(np.asarray(result["x"]).ravel(), 0.0, fastest) ** 2
    return Reference(speed_sq, float(motion_of(station, speed_sq)[1][-1]), iterations)
