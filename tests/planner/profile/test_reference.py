"""The offline optimum: closed forms, and what the fast planner makes of the same problems."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.planner.kernels.limits import planning_limits
from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.profile.reference import (
    JerkLimitedReference,
    TimeOptimalProblem,
    TimeOptimalReference,
    time_optimal_problem,
)
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.time_optimal import profile_problem
from tests.planner.profile.test_smoothing import assert_exact, problem_of, travel_time, wavy
from tests.planner.profile.test_smoothing import optimum as jerk_optimum
from tests.planner.profile.test_time_optimal import Road, road
from tests.planner.scenes import arc, ground_map, model_of, straight, tables_with


def problem_on(r: Road) -> TimeOptimalProblem:
    return TimeOptimalProblem(
        r.station,
        r.bound**2,
        r.sin_grade,
        r.lower_slope,
        r.lower_intercept,
        r.slowest,
        r.accel_max,
        r.demand,
        r.start**2,
        r.scalars.decel,
        r.scalars.specific_power,
    )


def test_a_level_road_has_its_closed_form() -> None:
    """30 m at most 3 m/s with 1 m/s² up and 1.5 m/s² down."""
    r = road(301, bound=3.0)
    solution = TimeOptimalReference(301).solve(problem_on(r))
    assert solution.reason == ""
    accelerating, braking = 3.0, 2.0
    cruising = (30.0 - 4.5 - 3.0) / 3.0
    assert solution.travel_time == pytest.approx(accelerating + cruising + braking, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_the_two_passes_are_optimal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 81
    s = np.linspace(0.0, 20.0, n)
    r = road(
        n,
        0.25,
        bound=2.5 + np.sin(s / rng.uniform(1.5, 3.0) + rng.uniform(0.0, 6.0)),
        sin_grade=0.15 * np.sin(s / 3.0 + rng.uniform(0.0, 6.0)),
        lower_intercept=0.35 + 0.05 * np.cos(s),
        lower_slope=rng.uniform(-0.02, 0.02),
        start=rng.uniform(0.0, 1.5),
    )
    speed_sq, _ = r.solve()
    time = travel_time(speed_sq, np.diff(r.station))
    solution = TimeOptimalReference(n).solve(problem_on(r))
    assert solution.speed_sq is not None
    assert time == pytest.approx(solution.travel_time, rel=1e-3)
    assert np.all(solution.speed_sq <= speed_sq + 1e-4)


@pytest.mark.parametrize("unknown_from", [9.0, 99.0])
def test_candidates_out_of_a_batch_are_optimal(unknown_from: float) -> None:
    def hills(x: Any, y: Any) -> Any:
        return 0.4 * np.sin(x / 3.0) + 0.2 * np.cos(y / 2.0)

    model = model_of(tables_with())
    ground = ground_map(hills, unknown=lambda x, y: x > unknown_from)
    part = batch([straight(16.0), arc(12.0, 0.12)], 0.25)
    solved = time_optimal_batch(ground, part, model, start_speed=0.5)
    batched = profile_problem(
        solved.profile, solved.ground, solved.bounds, planning_limits(model), np.full(2, 0.25)
    )
    for j in range(2):
        n = int(part.count[j])
        problem = time_optimal_problem(batched, j, n)
        solution = TimeOptimalReference(n).solve(problem)
        assert solution.speed_sq is not None, solution.reason
        time = travel_time(solved.speed_sq[:n, j], np.diff(problem.station))
        assert time == pytest.approx(solution.travel_time, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_jerk_limited_problems_agree_with_another_formulation(seed: int) -> None:
    p = problem_of(wavy(seed), 2.0)
    solution = JerkLimitedReference(101).solve(p)
    assert solution.speed_sq is not None, solution.reason
    assert solution.travel_time == pytest.approx(jerk_optimum(p), rel=2e-3)
    mine = smooth(p)
    assert mine.speed_sq is not None
    assert_exact(p, mine.speed_sq)
    assert travel_time(mine.speed_sq, p.ds) == pytest.approx(solution.travel_time, rel=0.01)


def test_plans_of_the_planner_are_within_a_percent_of_the_optimum() -> None:
    """From map to plan: smoothed plans against the jerk-limited optimum under the same top."""
    model = model_of(tables_with())
    ground = ground_map(lambda x, y: 0.4 * np.sin(x / 3.0) + 0.2 * np.cos(y / 2.0))
    path = arc(16.0, 0.05)
    (plan,) = CandidatePlanner(model).plan(ground, [path])
    part = batch([path], 0.25)
    solved = time_optimal_batch(ground, part, model)
    n = len(plan.station)
    top = solved.speed_sq[:n, 0]
    ds = np.diff(plan.station)
    accel = np.minimum(solved.bounds.accel_max[:-1, 0], solved.bounds.accel_max[1:, 0])
    p = SmoothingProblem(ds, top, accel, np.full(n - 1, 1.5), 2.0)
    solution = JerkLimitedReference(n).solve(p)
    assert solution.speed_sq is not None, solution.reason
    assert plan.travel_time == pytest.approx(solution.travel_time, rel=0.01)


def test_what_cannot_be_solved_says_so() -> None:
    p = problem_of(wavy(1), 2.0)
    solution = JerkLimitedReference(101, max_iterations=1).solve(p)
    assert solution.speed_sq is None
    assert solution.reason.startswith("IPOPT")
    assert np.isnan(solution.travel_time)
