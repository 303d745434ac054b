"""Candidate by candidate: the planner beside other tools, on the same problems."""

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
from slopewise.planner.settings import Solver
from slopewise.planner.verify.judge import check
from slopewise.planner.verify.track import track_of

from ..common.judge import excess, smooth_excess, travel_time
from ..common.measure import summary, timed
from ..common.scene import Scene
from . import quadratic
from .peers import PEERS, PeerTask

Result = dict[str, Any]
Problem = TypeVar("Problem")
Answer = tuple[float, float]
"""Travel time [s] and largest excess of a solution."""

_FAULTS = (AttributeError, TypeError, ValueError, RuntimeError)
"""What a tool raises whose version does not fit."""


def chosen_from(solved: TimeOptimalBatch, wanted: int) -> list[int]:
    """Candidates that are free to their end, spread over the batch."""
    free = np.flatnonzero(solved.bounds.barrier_station >= solved.profile.count)
    return [int(j) for j in free[np.linspace(0, len(free) - 1, wanted).astype(int)]]


def tasks_of(scene: Scene, chosen: Sequence[int]) -> list[PeerTask]:
    """Candidates of a scene, each up to the station where it must rest."""
    solved, limits = scene.plan(), scene.model.limits
    start = np.zeros(len(solved.profile.count))
    batch = profile_problem(
        solved.profile, solved.ground, solved.bounds, planning_limits(scene.model), start
    )
    tasks = []
    for j in chosen:
        problem = time_optimal_problem(batch, j, int(solved.profile.count[j]))
        problem = problem.until(int(np.flatnonzero(problem.speed_sq_max > 0.0)[-1]) + 2)
        tasks.append(
            PeerTask(problem.station, problem.speed_sq_max, limits.accel, limits.decel, problem)
        )
    return tasks


def time_optimal(scene: Scene, tasks: Sequence[PeerTask], rounds: int) -> list[Result]:
    """The time-optimal problem: the planner's profile stage and its peers."""

    def judged(task: PeerTask, speed_sq: Floats) -> Answer:
        n = len(task.station) - 1
        accel, decel = np.full(n, task.accel), np.full(n, task.decel)
        over = excess(task.station, speed_sq, task.speed_sq_max, accel, decel)
        return travel_time(task.station, speed_sq), over

    rows = [_row("planner, one candidate", tasks, partial(planner_alone, scene), judged, rounds)]
    return rows + [_row(name, tasks, peer, judged, rounds) for name, peer in PEERS.items()]


def planner_alone(scene: Scene, task: PeerTask) -> Callable[[], Floats]:
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


def jerk_limited(scene: Scene, tasks: Sequence[PeerTask], rounds: int) -> list[Result]:
    """The jerk-limited problem by the planner, and the same program by other solvers."""
    problems = [smoothing_problem(scene, task) for task in tasks]

    def reference(problem: SmoothingProblem) -> Callable[[], Floats | None]:
        program = JerkLimitedReference(len(problem.speed_sq_max))
        return lambda: program.solve(problem).speed_sq

    peers: dict[str, Callable[[SmoothingProblem], Callable[[], Floats | None]]] = {
        "planner": smoother_of,
        'planner, solver = "osqp"': partial(smoother_of, first="osqp"),
        'planner, solver = "ipopt"': partial(smoother_of, first="ipopt"),
        "OSQP": quadratic.osqp,
        "PIQP": quadratic.piqp,
        "Clarabel": quadratic.clarabel,
        "CasADi + IPOPT": reference,
    }
    return [_row(name, problems, peer, smooth_answer, rounds) for name, peer in peers.items()]


def smoothing_problem(scene: Scene, task: PeerTask) -> SmoothingProblem:
    """Bound by the time-optimal profile; limits that hold at any speed up to it."""
    p, limits = task.problem, scene.model.limits
    speed_sq = planner_alone(scene, task)()
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


def smoother_of(
    problem: SmoothingProblem, first: Solver = "interior_point"
) -> Callable[[], Floats | None]:
    """The planner's smoothing, by the solver of its settings."""
    return lambda: smooth(problem, first).speed_sq


def smooth_answer(problem: SmoothingProblem, speed_sq: Floats) -> Answer:
    """Travel time and excess of a smoothed profile."""
    station = np.concatenate(([0.0], np.cumsum(problem.ds)))
    return travel_time(station, speed_sq), smooth_excess(problem, speed_sq)


def emitted(scene: Scene, chosen: Sequence[int], rounds: int) -> list[Result]:
    """What each plan that is emitted costs: the judge alone, and all of it."""
    solved, model = scene.plan(), scene.model
    judging: list[float] = []
    finishing: list[float] = []
    for j in chosen:
        judge = partial(
            check,
            track_of(solved.profile, solved.ground, j),
            np.ascontiguousarray(solved.speed_sq[:, j]),
            float(solved.bounds.clear_distance[j]),
            float(solved.ground.distance_offset[j]),
            solved.ground.motion,
            model,
        )
        finish = partial(finished, solved, j, "plan", smooth=True)
        for action, seconds in ((judge, judging), (finish, finishing)):
            action()
            seconds += [timed(action)[0] for _ in range(rounds)]
    return [
        {"name": "judge", **summary(judging)},
        {"name": "plan smoothed, judged, explained", **summary(finishing)},
    ]


def _row(
    name: str,
    problems: Sequence[Problem],
    make: Callable[[Problem], Callable[[], Floats | None]],
    judged: Callable[[Problem, Floats], Answer],
    rounds: int,
) -> Result:
    """One tool on all problems: times, mean travel time and largest excess of its solutions."""
    seconds: list[float] = []
    answers: list[Answer] = []
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
            answers.append(judged(problem, speed_sq))
    row: Result = {"name": name, **summary(seconds), "solved": len(answers), "of": len(problems)}
    if answers:
        row["travel_time"] = float(np.mean([time for time, _ in answers]))
        row["excess"] = max(over for _, over in answers)
    return row
