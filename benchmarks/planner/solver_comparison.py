"""The planner compared with other solvers on the same problems, candidate by candidate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.limits import planning_limits
from slopewise.planner.pipeline.candidates import finished
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch
from slopewise.planner.profile.reference import JerkLimitedReference, time_optimal_problem
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.time_optimal import (
    ProfileProblem,
    profile_problem,
    time_optimal_profile,
)
from slopewise.planner.verify.judge import check
from slopewise.planner.verify.track import track_of

from ..common.profile_quality import excess, smooth_excess, stations_of, travel_time
from ..common.scene import BenchmarkScene
from ..common.timing import summary, timed
from . import quadratic
from .planner_baselines import BASELINES, BaselineTask

Result = dict[str, Any]
Problem = TypeVar("Problem")
Solve = Callable[[], Floats | None]
Quality = tuple[float, float]
"""Travel time [s] and largest excess of a solution."""

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
    batch = profile_problem(
        solved.profile, solved.ground, solved.bounds, planning_limits(scene.model), start
    )
    tasks = []
    for j in candidates:
        problem = time_optimal_problem(batch, j, int(solved.profile.count[j]))
        problem = problem.until(int(np.flatnonzero(problem.speed_sq_max > 0.0)[-1]) + 2)
        tasks.append(BaselineTask(limits.accel, limits.decel, problem))
    return tasks


def time_optimal(scene: BenchmarkScene, tasks: Sequence[BaselineTask], rounds: int) -> list[Result]:
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
    p = task.problem

    def column(values: Floats) -> Floats:
        return np.ascontiguousarray(values[:, None])

    problem = ProfileProblem(
        column(p.station),
        column(p.speed_sq_max),
        column(p.sin_grade),
        column(p.lower_slope),
        column(p.lower_intercept),
        column(p.slowest),
        column(p.accel_max),
        column(p.demand),
        np.array([p.start_sq]),
        p.decel,
        p.specific_power,
    )
    return lambda: time_optimal_profile(problem)[0][:, 0]


def jerk_limited(scene: BenchmarkScene, tasks: Sequence[BaselineTask], rounds: int) -> list[Result]:
    """The jerk-limited problem by the planner, and the same program by other solvers."""
    problems = [smoothing_problem(scene, task) for task in tasks]

    def reference(problem: SmoothingProblem) -> Solve:
        program = JerkLimitedReference(len(problem.speed_sq_max))
        return lambda: program.solve(problem).speed_sq

    def quality(problem: SmoothingProblem, speed_sq: Floats) -> Quality:
        time = travel_time(stations_of(problem), speed_sq)
        return time, smooth_excess(problem, speed_sq)

    makers: dict[str, Callable[[SmoothingProblem], Solve]] = {
        "planner": lambda problem: lambda: smooth(problem).speed_sq,
        'planner, solver = "osqp"': lambda problem: lambda: smooth(problem, "osqp").speed_sq,
        'planner, solver = "ipopt"': lambda problem: lambda: smooth(problem, "ipopt").speed_sq,
        "OSQP": quadratic.osqp,
        "PIQP": quadratic.piqp,
        "Clarabel": quadratic.clarabel,
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
    verifying: list[float] = []
    finishing: list[float] = []
    for j in candidates:
        verify = partial(
            check,
            track_of(solved.profile, solved.ground, j),
            np.ascontiguousarray(solved.speed_sq[:, j]),
            float(solved.bounds.clear_distance[j]),
            float(solved.ground.distance_offset[j]),
            solved.ground.motion,
            model,
        )
        finish = partial(finished, solved, j, "plan", smooth=True)
        for action, seconds in ((verify, verifying), (finish, finishing)):
            action()
            seconds += [timed(action)[0] for _ in range(rounds)]
    return [
        {"name": "judge", **summary(verifying)},
        {"name": "plan smoothed, judged, explained", **summary(finishing)},
    ]


def _row(
    name: str,
    problems: Sequence[Problem],
    make: Callable[[Problem], Solve],
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
