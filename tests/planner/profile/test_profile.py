"""Jerk-limited profiles: exact in their constraints, close to what an optimiser finds.

Time-optimal profiles against closed forms, an optimiser, and their own constraints.

The offline optimum: closed forms, and what the fast planner makes of the same problems.
"""

from __future__ import annotations

import dataclasses
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.common.time_optimal_reference import TimeOptimalReference
from slopewise.models.laws import drive
from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.profile import smoothing
from slopewise.planner.profile.problems import ProfileProblem, SmoothingProblem
from slopewise.planner.profile.reference import JerkLimitedReference
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.settings import Solver
from tests.world.ground import arc, ground_map, hills
from tests.world.roads import BIG, Road, assert_exact, problem_of, road, travel_time, wavy
from tests.world.vehicles import G, model_of, tables_with


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("jerk", "share"), [(1.0, 0.01), (4.0, 0.005)])
def test_exact_constraints_hold_and_the_time_is_close_to_the_optimisers(
    seed: int, jerk: float, share: float
) -> None:
    p = problem_of(wavy(seed, start=0.0 if seed % 2 else 1.0), jerk)
    result = smooth(p)
    assert result.reason == ""
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    time, best = (
        travel_time(result.speed_sq, p.ds),
        JerkLimitedReference(len(p.speed_sq_max)).solve(p).travel_time,
    )
    assert time <= best * (1.0 + share)
    assert time >= best * (1.0 - 1e-3)


def test_the_start_is_unchanged_and_rest_stays_rest() -> None:
    r = wavy(4, start=1.3)
    r.bound[60:] = 0.0
    p = problem_of(r, 2.0)
    result = smooth(p)
    assert result.speed_sq[0] == pytest.approx(1.69)
    assert np.all(result.speed_sq[60:] == 0.0)
    assert result.speed_sq[30] > 0.0


@pytest.mark.parametrize("bound", [2e-5, 8e-4, 0.0])
def test_no_vehicle_creeps_on(bound: float) -> None:
    r = road(81, 0.25, bound=3.0)
    r.bound[60:62] = bound
    fastest, _ = r.solve()
    smooth_one = smooth(problem_of(r, 2.0)).speed_sq
    assert smooth_one is not None
    for speed_sq in (fastest, smooth_one):
        assert np.all(speed_sq[60:] == 0.0)
        assert np.all(speed_sq[1:60] > 0.01)
    r.bound[61] = 3.0
    past_one_station, _ = r.solve()
    assert np.all(past_one_station[61:-1] > 0.01)


@pytest.mark.parametrize("start_accel", [-1.0, 0.0, 1.0])
def test_the_acceleration_before_the_start_is_taken_on(start_accel: float) -> None:
    r = road(101, 0.25, bound=3.0, start=2.0)
    p = problem_of(r, 1.0, start_accel)
    result = smooth(p)
    assert result.speed_sq is not None
    first = np.diff(result.speed_sq)[0] / (2.0 * p.ds[0])
    # One segment at 2 m/s takes an eighth of a second.
    assert abs(first - start_accel) <= 0.126
    if start_accel < 0.0:
        assert first < 0.0


@pytest.mark.parametrize("start_accel", [-0.97, -0.5])
def test_a_start_that_brakes_hard_at_low_jerk_is_solved_as_well(start_accel: float) -> None:
    """The vehicle nearly stops before it can accelerate: far from the time-optimal profile."""
    r = road(80, 0.25, bound=3.0, start=0.83, accel_max=1.85)
    p = problem_of(r, 0.88, start_accel)
    result = smooth(p)
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    assert (
        travel_time(result.speed_sq, p.ds)
        <= JerkLimitedReference(len(p.speed_sq_max)).solve(p).travel_time * 1.01
    )


@pytest.mark.parametrize("n", [2, 3, 4])
def test_paths_of_few_stations_are_solved_as_well(n: int) -> None:
    p = SmoothingProblem(
        np.full(n - 1, 0.25),
        np.append(np.full(n - 1, 0.2), 0.0),
        np.ones(n - 1),
        np.ones(n - 1),
        4.0,
    )
    result = smooth(p)
    assert result.speed_sq[0] == 0.2
    assert result.speed_sq[-1] == 0.0
    assert_exact(p, result.speed_sq)


SOLVERS: tuple[Solver, ...] = get_args(Solver)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", [0, 3])
def test_whoever_is_asked_first_is_exact_and_as_fast(solver: Solver, seed: int) -> None:
    p = problem_of(wavy(seed), 2.0, 0.3 if seed % 2 == 0 else None)
    result = smooth(p, solver)
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    assert (
        travel_time(result.speed_sq, p.ds)
        <= JerkLimitedReference(len(p.speed_sq_max)).solve(p).travel_time * 1.02
    )
    assert np.array_equal(result.speed_sq, smooth(p).speed_sq) == (solver == "interior_point")


def test_where_the_chosen_solver_fails_the_default_one_answers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    p = problem_of(wavy(5), 2.0)
    monkeypatch.setattr(smoothing, "nearest_by_osqp", lambda top, *_: (-7, top))
    default, result = smooth(p), smooth(p, "osqp")
    assert default.speed_sq is not None
    np.testing.assert_array_equal(result.speed_sq, default.speed_sq)
    assert result.iterations == default.iterations + 7


@pytest.mark.parametrize("solver", SOLVERS)
def test_where_nothing_is_feasible_each_says_so(solver: Solver) -> None:
    """Full acceleration requested immediately where only braking is allowed."""
    r = road(41, 0.25, bound=np.linspace(2.0, 0.5, 41), start=2.0)
    result = smooth(problem_of(r, 0.5, start_accel=5.0), solver)
    assert result.speed_sq is None
    assert "jerk limit" in result.reason


def test_a_level_road_is_accelerate_hold_brake() -> None:
    r = road(401, bound=3.0)
    speed_sq, _ = r.solve()
    s, end = r.station, r.station[-1]
    exact = np.minimum(np.minimum(2.0 * 1.0 * s, 9.0), 2.0 * 1.5 * (end - s))
    np.testing.assert_allclose(speed_sq, exact, atol=1e-9)


def test_a_faster_start_keeps_its_speed_and_has_the_reachable_stations() -> None:
    r = road(101, start=4.0)
    speed_sq, reachable = r.solve()
    assert speed_sq[0] == pytest.approx(16.0)
    assert reachable == pytest.approx(2.0 * 1.5 * 10.0)
    r = road(101, start=9.0)
    speed_sq, reachable = r.solve()
    assert reachable == pytest.approx(30.0)
    assert reachable < r.start**2
    assert speed_sq[0] == pytest.approx(reachable)


def test_power_limits_the_acceleration_and_the_top_speed() -> None:
    vehicle = model_of(tables_with()).vehicle
    power = 0.5 * vehicle.max_drive_power
    r = road(
        4001,
        0.05,
        demand=0.13,
        accel_max=1.5,
        scalars={"specific_power": power / (vehicle.mass * G)},
        end=50.0,
    )
    speed_sq, _ = r.solve()
    speed, accel = np.sqrt(speed_sq), np.diff(speed_sq) / 0.1
    top = drive.sustained_speed(0.0, vehicle.mass, power, 0.13)
    assert speed[-1] == pytest.approx(top, rel=5e-3)
    assert speed.max() <= top
    for k in range(10, 4000, 400):
        limit = drive.powered_accel_limit(speed[k + 1], 0.0, 0.0, vehicle.mass, BIG, power, 0.13)
        assert accel[k] <= limit + 1e-9
        # Taken at the bound of the segment's end: first order in the spacing.
        assert accel[k] >= min(1.5, limit) - 0.05
    assert accel[0] == pytest.approx(1.5)


@st.composite
def roads(draw: st.DrawFn) -> Road:
    n = draw(st.integers(3, 40))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    wavy = rng.uniform(0.2, 4.0, n)
    if draw(st.booleans()):
        wavy[rng.integers(0, n)] = 0.0
    r = road(
        n,
        draw(st.sampled_from([0.05, 0.25, 1.0])),
        bound=wavy,
        sin_grade=rng.uniform(-0.2, 0.2, n),
        lower_intercept=rng.uniform(0.3, 0.8, n),
        lower_slope=rng.uniform(-0.04, 0.04, n),
        slowest=draw(st.sampled_from([0.0, 1.0])),
        accel_max=rng.uniform(0.0, 1.5, n),
        demand=rng.uniform(-0.1, 0.3, n),
        start=draw(st.floats(0.0, 3.0)),
        end=draw(st.sampled_from([0.0, 2.0])),
        scalars={"decel": draw(st.floats(0.3, 5.0))},
    )
    return r


@settings(max_examples=60)
@given(r=roads())
def test_no_constraint_is_breached_on_any_segment(r: Road) -> None:
    speed_sq, reachable = r.solve()
    assert np.all(speed_sq <= r.bound**2 + 1e-12)
    assert np.all(speed_sq >= 0.0)
    assert speed_sq[0] == pytest.approx(min(r.start**2, reachable))
    accel = np.diff(speed_sq) / (2.0 * np.diff(r.station))
    speed = np.sqrt(speed_sq)
    for k, a in enumerate(accel):
        assert a <= min(r.accel_max[k], r.accel_max[k + 1]) + 1e-9
        ends = [r.braking(m, v) for m in (k, k + 1) for v in (speed[k], speed[k + 1])]
        assert -a <= min(r.scalars.decel, *ends) + 1e-9 or speed_sq[k] == 0.0


@given(r=roads(), share=st.floats(0.3, 1.0), where=st.integers(0, 100))
def test_lowering_any_bound_never_makes_any_station_faster(
    r: Road, share: float, where: int
) -> None:
    before, _ = r.solve()
    lower = dataclasses.replace(r, bound=r.bound.copy())
    lower.bound[where % len(lower.bound)] *= share
    after, _ = lower.solve()
    assert np.all(after <= before + 1e-9)


def problem_on(r: Road) -> ProfileProblem:
    return ProfileProblem(
        r.station,
        r.bound**2,
        r.sin_grade,
        r.lower_slope,
        r.lower_intercept,
        r.slowest,
        r.accel_max,
        r.demand,
        np.array([r.start**2]),
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
