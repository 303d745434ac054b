"""Jerk-limited profiles: exact in their constraints, close to what an optimiser finds."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from slopewise.planner.profile import smoothing
from slopewise.planner.profile.reference import JerkLimitedReference
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.settings import Solver
from tests.world.roads import assert_exact, problem_of, road, travel_time, wavy


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
    assert result.speed_sq is not None
    assert result.speed_sq[0] == pytest.approx(1.69)
    assert np.all(result.speed_sq[60:] == 0.0)
    assert result.speed_sq[30] > 0.0


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
def test_a_start_that_brakes_hard_at_low_jerk_is_solved_as_well(
    start_accel: float,
) -> None:
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
    assert result.speed_sq is not None
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
    monkeypatch.setattr(smoothing, "nearest_by_osqp", lambda *_: -7)
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
