"""The planner compared with other solvers on the same problems, candidate by candidate.

A tool that is not installed raises ImportError when it is built, which its row reports.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import StopErrors
from slopewise.planner.pipeline.candidates import finished
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.profile.problems import ProfileProblem, SmoothingProblem, profile_problem
from slopewise.planner.profile.reference import JerkLimitedReference
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.verify.terms import terms_of
from slopewise.planner.verify.verifier import check, track_of

from ..common.campaign import Result
from ..common.profile_quality import excess, smooth_excess, stations_of, travel_time
from ..common.scene import BenchmarkScene
from ..common.time_optimal_reference import TimeOptimalReference, problem_of_one, with_columns
from ..common.timing import summary, timed

_MIN_SPEED = 1e-3  # Lowest speed bound that all tools accept [m/s]
_LATERAL_GRIP = 10.0  # of the planning helpers: large, so that longitudinal limits apply [m/s²]


@dataclass(frozen=True, slots=True)
class BaselineTask:
    """One candidate up to the station where it must rest."""

    accel: float  # accel, decel: service limits [m/s²]
    decel: float
    problem: ProfileProblem  # stations, bounds, brakes and drive

    @property
    def speed_max(self) -> Floats:
        """Positive bound of the speed, shape (N,) [m/s]."""
        return np.maximum(np.sqrt(self.problem.speed_sq_max), _MIN_SPEED)


Solver = Callable[[], Floats | None]


def toppra(task: BaselineTask) -> Solver:
    """Time-optimal path parameterisation by reachability analysis (TOPP-RA)."""
    logging.getLogger("toppra").setLevel(logging.ERROR)
    ta = importlib.import_module("toppra")
    constraint = importlib.import_module("toppra.constraint")
    algorithm = importlib.import_module("toppra.algorithm")
    station, speed = task.problem.station, task.speed_max

    def limits(s: float) -> Floats:
        top = float(np.interp(s, station, speed))
        return np.array([[-top, top]])

    path = ta.SplineInterpolator(station, station[:, None])
    constraints = [
        constraint.JointVelocityConstraintVarying(limits),
        constraint.JointAccelerationConstraint(np.array([[-task.decel, task.accel]])),
    ]
    instance = algorithm.TOPPRA(constraints, path, gridpoints=station, solver_wrapper="seidel")

    def solve() -> Floats | None:
        _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
        return None if speeds is None else np.asarray(speeds) ** 2

    return solve


def planning_helpers(task: BaselineTask) -> Solver:
    """Forward–backward solver of the trajectory-planning-helpers.

    It derives speed bounds from curvature only and shares the grip between the directions, so the
    bounds are given to it as curvatures.
    """
    calculate = _submodule("trajectory_planning_helpers", "calc_vel_profile").calc_vel_profile
    speed = task.speed_max
    ds = np.diff(task.problem.station)
    grip = np.tile([task.decel, _LATERAL_GRIP], (len(speed), 1))
    machines = np.array([[0.0, task.accel], [2.0 * float(speed.max()), task.accel]])

    motion = {"v_max": float(speed.max()), "v_start": 0.1, "v_end": 0.0, "dyn_model_exp": 2.0}
    body = {"drag_coeff": 0.0, "m_veh": 1.0, "loc_gg": grip, "ax_max_machines": machines}
    path = {"kappa": _LATERAL_GRIP / speed**2, "el_lengths": ds, "closed": False}
    return lambda: np.asarray(calculate(**path, **body, **motion)) ** 2


def ipopt(task: BaselineTask) -> Solver:
    """The exact discrete problem with the braking model, by CasADi and IPOPT."""
    reference = TimeOptimalReference(len(task.problem.station))
    return lambda: reference.solve(task.problem).speed_sq


BASELINES: dict[str, Callable[[BaselineTask], Solver]] = {
    "toppra": toppra,
    "trajectory-planning-helpers": planning_helpers,
    "CasADi + IPOPT": ipopt,
}
"""Builders of solvers; only the returned solver is timed."""


def _submodule(package: str, name: str) -> Any:
    """Import one module of a package without its ``__init__``, which loads unused solvers."""
    if package not in sys.modules:
        spec = importlib.util.find_spec(package)
        if spec is None:
            raise ImportError(package)
        bare = types.ModuleType(package)
        bare.__path__ = list(spec.submodule_search_locations or [])
        sys.modules[package] = bare
    return importlib.import_module(f"{package}.{name}")


Problem = TypeVar("Problem")
Quality = tuple[float, float]  # Travel time [s] and largest excess of a solution
_FAULTS = (AttributeError, TypeError, ValueError, RuntimeError)
"""Raised by a tool whose version does not fit."""


def select_free(solved: TimeOptimalBatch, count: int) -> list[int]:
    """Candidates that are free to their end, spread over the batch."""
    free = np.flatnonzero(solved.bounds.barrier_station >= solved.profile.count)
    return [int(j) for j in free[np.linspace(0, len(free) - 1, count).astype(int)]]


def tasks_of(scene: BenchmarkScene, candidates: Sequence[int]) -> list[BaselineTask]:
    """Candidates of a scene, each up to the station where it must rest."""
    solved, limits = scene.plan(), scene.model.limits
    start = np.zeros(len(solved.profile.count))
    parts = (solved.profile, solved.ground, solved.bounds)
    batch = profile_problem(*parts, planning_limits(scene.model), start)
    tasks = []
    for j in candidates:
        count = int(solved.profile.count[j])
        rest = int(np.flatnonzero(batch.speed_sq_max[:count, j] > 0.0)[-1]) + 2
        problem = problem_of_one(batch, j, min(rest, count))
        tasks.append(BaselineTask(limits.accel, limits.decel, problem))
    return tasks


def time_optimal(tasks: Sequence[BaselineTask], rounds: int) -> list[Result]:
    """The time-optimal problem: the planner's profile stage and its baselines."""

    def quality(task: BaselineTask, speed_sq: Floats) -> Quality:
        station, top = task.problem.station, task.problem.speed_sq_max
        n = len(station) - 1
        limits = (np.full(n, task.accel), np.full(n, task.decel))
        return travel_time(station, speed_sq), excess(station, speed_sq, top, *limits)

    makers = {"planner, one candidate": profile_stage, **BASELINES}
    return [_row(name, tasks, make, quality, rounds) for name, make in makers.items()]


def profile_stage(task: BaselineTask) -> Callable[[], Floats]:
    """The planner's profile stage on one candidate, exact in brakes and drive."""
    problem = with_columns(task.problem, lambda values: values[:, None], task.problem.start_sq)
    return lambda: core.time_optimal(problem)[0][:, 0]


def jerk_limited(scene: BenchmarkScene, tasks: Sequence[BaselineTask], rounds: int) -> list[Result]:
    """The jerk-limited problem by the planner's solvers, and without its tangents by IPOPT."""
    problems = [smoothing_problem(scene, task) for task in tasks]

    def reference(problem: SmoothingProblem) -> Solver:
        program = JerkLimitedReference(len(problem.speed_sq_max))
        return lambda: program.solve(problem).speed_sq

    def quality(problem: SmoothingProblem, speed_sq: Floats) -> Quality:
        return travel_time(stations_of(problem), speed_sq), smooth_excess(problem, speed_sq)

    makers: dict[str, Callable[[SmoothingProblem], Solver]] = {
        "planner": lambda problem: lambda: smooth(problem).speed_sq,
        'planner, solver = "osqp"': lambda problem: lambda: smooth(problem, "osqp").speed_sq,
        'planner, solver = "ipopt"': lambda problem: lambda: smooth(problem, "ipopt").speed_sq,
        "CasADi + IPOPT": reference,
    }
    return [_row(name, problems, make, quality, rounds) for name, make in makers.items()]


def smoothing_problem(scene: BenchmarkScene, task: BaselineTask) -> SmoothingProblem:
    """Problem bounded by the time-optimal profile, with limits valid at any speed up to it."""
    p, limits = task.problem, scene.model.limits
    speed_sq = profile_stage(task)()
    fast = np.sqrt(np.maximum(speed_sq, 1e-6))
    hold = GRAVITY * np.maximum(p.demand[:-1], p.demand[1:])
    powered = GRAVITY * p.specific_power / np.maximum(fast[:-1], fast[1:]) - hold
    accel = np.minimum(np.minimum(p.accel_max[:-1], p.accel_max[1:]), powered)
    force = np.minimum(p.slowest * p.lower_slope, np.maximum(fast, p.slowest) * p.lower_slope)
    braking = GRAVITY * (force + p.lower_intercept + p.sin_grade)
    decel = np.minimum(np.minimum(braking[:-1], braking[1:]), limits.decel)
    return SmoothingProblem(
        np.diff(p.station), speed_sq, np.maximum(accel, 0.0), np.maximum(decel, 0.0), limits.jerk
    )


def emitted(scene: BenchmarkScene, candidates: Sequence[int], rounds: int) -> list[Result]:
    """Cost of each emitted plan: the verifier alone, and all of it."""
    solved, model = scene.plan(), scene.model
    seconds: dict[str, list[float]] = {"judge": [], "plan smoothed, judged, explained": []}
    for j in candidates:
        track = track_of(solved.profile, solved.ground, j)
        speed_sq = np.ascontiguousarray(solved.speed_sq[:, j])
        clear, offset = solved.bounds.clear_distance[j], solved.ground.distance_offset[j]
        terms = terms_of(model, solved.ground.motion, StopErrors())
        verify = partial(check, track, speed_sq, float(clear), float(offset), terms)
        finish = partial(finished, solved, j, "plan", smooth=True)
        actions: tuple[Callable[[], Any], ...] = (verify, finish)
        for times, action in zip(seconds.values(), actions, strict=True):
            action()
            times += [timed(action)[0] for _ in range(rounds)]
    return [{"name": name, **summary(times)} for name, times in seconds.items()]


def _row(
    name: str,
    problems: Sequence[Problem],
    make: Callable[[Problem], Solver],
    quality: Callable[[Problem, Floats], Quality],
    rounds: int,
) -> Result:
    """Times of one solver on all problems, mean travel time and largest excess."""
    seconds: list[float] = []
    solved: list[Quality] = []
    for problem in problems:
        try:
            solve = make(problem)
            speed_sq = solve()
        except ImportError:
            return {"name": name, "note": "not installed"}
        except _FAULTS as fault:
            return {"name": name, "note": f"failed: {fault}"}
        seconds += [timed(solve)[0] for _ in range(rounds)]
        if speed_sq is not None and np.all(np.isfinite(speed_sq)) and np.any(speed_sq > 0.0):
            solved.append(quality(problem, speed_sq))
    row: Result = {"name": name, **summary(seconds), "solved": len(solved), "of": len(problems)}
    if solved:
        row["travel_time"] = float(np.mean([time for time, _ in solved]))
        row["excess"] = max(over for _, over in solved)
    return row
