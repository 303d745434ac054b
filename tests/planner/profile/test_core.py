"""The compiled core: against definitions in numpy, at any number of lanes, under sanitizers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from slopewise.planner.compiled_core import core
from slopewise.planner.profile.osqp_nearest import matrix_of
from slopewise.planner.profile.problems import ProfileProblem, SmoothingProblem
from slopewise.planner.profile.smoothing import smooth
from tests.planner.profile import reference_profile as reference
from tests.world.roads import problem_of, wavy


def random_problem(seed: int, n: int = 40, m: int = 3) -> ProfileProblem:
    rng = np.random.default_rng(seed)
    bound = rng.uniform(0.2, 3.0, (n, m))
    bound[-1] = 0.0
    bound[rng.integers(0, n), 0] = 0.0
    return ProfileProblem(
        station=np.cumsum(rng.uniform(0.05, 0.5, (n, m)), 0),
        speed_sq_max=bound**2,
        sin_grade=rng.uniform(-0.2, 0.2, (n, m)),
        lower_slope=rng.uniform(-0.04, 0.04, (n, m)),
        lower_intercept=rng.uniform(0.1, 0.6, (n, m)),
        slowest=np.full((n, m), float(seed % 2)),
        accel_max=rng.uniform(0.2, 1.5, (n, m)),
        demand=rng.uniform(-0.1, 0.3, (n, m)),
        start_sq=rng.uniform(0.0, 4.0, m),
        decel=(1.5, np.inf, 6.0)[seed % 3],
        specific_power=(0.05, 0.5)[seed % 2],
    )


@pytest.mark.parametrize("seed", range(12))
def test_profiles_and_costs_are_as_defined(seed: int) -> None:
    problem = random_problem(seed)
    rng, shape = np.random.default_rng(seed), problem.station.shape
    problem = problem._replace(
        lift=rng.uniform(-0.5, 2.0, shape), lift_per_speed_sq=rng.uniform(0.0, 1.0, shape)
    )
    speed_sq, _ = core.time_optimal(problem)
    columns = *ProfileProblem._fields[:8], "lift", "lift_per_speed_sq"
    for j in range(speed_sq.shape[1]):
        rows = [
            SimpleNamespace(**{name: getattr(problem, name)[k, j] for name in columns})
            for k in range(speed_sq.shape[0])
        ]
        expected = reference.time_optimal(
            rows, problem.start_sq[j], problem.decel, problem.specific_power
        )
        np.testing.assert_allclose(speed_sq[:, j], expected, rtol=1e-12, atol=1e-12)
    speed, ds = np.sqrt(speed_sq), np.diff(problem.station, axis=0)
    total = speed[1:] + speed[:-1]
    time = np.where(total > 0.0, 2.0 * ds / np.where(total > 0.0, total, 1.0), 3.0 * ds)
    np.testing.assert_allclose(
        core.travel_cost(problem.station, speed_sq, 3.0), time.sum(axis=0), rtol=1e-12
    )


@pytest.mark.parametrize("candidates", [1, 7, 8, 9, 63, 64, 65, 100, 137])
def test_an_answer_does_not_depend_on_the_candidates_next_to_it(candidates: int) -> None:
    problem = random_problem(2, m=candidates)
    together, reachable = core.time_optimal(problem)
    for j in range(candidates):
        alone = ProfileProblem(
            *(np.ascontiguousarray(a[:, j : j + 1]) for a in problem[:8]),
            problem.start_sq[j : j + 1],
            problem.decel,
            problem.specific_power,
        )
        speed_sq, first = core.time_optimal(alone)
        np.testing.assert_array_equal(speed_sq[:, 0], together[:, j])
        assert first[0] == reachable[j]


@pytest.mark.parametrize("seed", range(4))
def test_the_rows_of_smoothing_are_as_defined(seed: int) -> None:
    road = wavy(seed, n=60)
    road.bound[40:43] = 0.0
    p = problem_of(road, 2.0)
    n = len(p.speed_sq_max)
    _, rows, limit = core.smoothing_program(p)
    computed = np.column_stack([matrix_of(rows).toarray(), limit.ravel()])
    given = p.ds, p.speed_sq_max, p.accel_max, p.decel_max, p.jerk
    expected = np.column_stack(reference.program(*given, p.speed_sq_max))
    computed = computed[np.any(computed[:, :n] != 0.0, axis=1)]
    assert len(computed) == len(expected)
    for row in expected:
        assert np.abs(computed - row).max(axis=1).min() <= 1e-12 * np.abs(row).max()


@pytest.mark.parametrize("seed", range(4))
def test_a_smoothed_profile_is_the_nearest(seed: int) -> None:
    """Against an active-set method, with tangents at the time-optimal profile."""
    p = problem_of(wavy(seed, n=60, start=0.0), 4.0)
    matrix, limits = reference.program(
        p.ds, p.speed_sq_max, p.accel_max, p.decel_max, p.jerk, p.speed_sq_max
    )
    is_open = p.speed_sq_max > reference.STANDSTILL_SQ
    is_open[0] = False
    nearest = p.speed_sq_max.copy()
    nearest[is_open] += reference.shortest(matrix[:, is_open], limits - matrix @ p.speed_sq_max)
    result = smooth(p)
    assert result.speed_sq is not None
    # The solver ends at a mean gap of 1e-7 a row; the objective is half the distance squared.
    gap = 1e-7 * core.KIND_COUNT * len(nearest)
    assert np.linalg.norm(result.speed_sq - nearest) <= np.sqrt(2.0 * gap)


def test_calls_from_many_threads_do_not_mix() -> None:
    p = problem_of(wavy(3), 2.0)
    expected = smooth(p).speed_sq
    assert expected is not None
    with ThreadPoolExecutor(4) as pool:
        for result in pool.map(lambda _: smooth(p).speed_sq, range(200)):
            np.testing.assert_array_equal(result, expected)


def test_a_wrong_shape_is_named() -> None:
    problem = random_problem(0, n=5, m=2)
    short = problem._replace(sin_grade=np.zeros((4, 2)))
    with pytest.raises(ValueError, match="sin_grade: expected 5 along axis 0, got 4"):
        core.time_optimal(short)
    with pytest.raises(ValueError, match="at least 3 stations"):
        core.smooth(SmoothingProblem(np.ones(1), np.ones(2), np.ones(1), np.ones(1), 1.0))
