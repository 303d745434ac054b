"""The offline optimum: closed forms, and what the fast planner makes of the same problems."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.profile.reference import (
    JerkLimitedReference,
    TimeOptimalProblem,
    TimeOptimalReference,
)
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from tests.world.ground import arc, ground_map, hills
from tests.world.roads import Road, problem_of, travel_time, wavy
from tests.world.vehicles import model_of, tables_with


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


@pytest.mark.parametrize("seed", range(3))
def test_the_two_passes_are_optimal(seed: int) -> None:
    r = wavy(seed)
    r.sin_grade[:] = 0.15 * np.sin(r.station / 3.0)
    r.lower_intercept[:], r.lower_slope[:] = 0.35 + 0.05 * np.cos(r.station), 0.01 * (seed - 1)
    speed_sq, _ = r.solve()
    time = travel_time(speed_sq, np.diff(r.station))
    solution = TimeOptimalReference(len(speed_sq)).solve(problem_on(r))
    assert solution.speed_sq is not None
    assert time == pytest.approx(solution.travel_time, rel=1e-3)
    assert np.all(solution.speed_sq <= speed_sq + 1e-4)


def test_plans_of_the_planner_are_within_a_percent_of_the_optimum() -> None:
    """From map to plan: smoothed plans against the jerk-limited optimum under the same top."""
    model = model_of(tables_with())
    ground = ground_map(hills)
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
