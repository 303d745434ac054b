"""Jerk-limited profiles: exact in their constraints, close to what an optimiser finds."""

from __future__ import annotations

from typing import get_args

import casadi as ca
import numpy as np
import pytest

from slopewise.planner.profile import smoothing
from slopewise.planner.profile.smoothing import smooth
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.settings import Solver
from tests.planner.profile.test_time_optimal import Road, road

TOLERANCE = 1e-6


def problem_of(r: Road, jerk: float, start_accel: float | None = None) -> SmoothingProblem:
    """The smoothing problem behind a road's time-optimal profile."""
    top, _ = r.solve()
    return SmoothingProblem(
        np.diff(r.station),
        top,
        np.minimum(r.accel_max[:-1], r.accel_max[1:]),
        np.full(len(top) - 1, r.scalars.decel),
        jerk,
        start_accel,
    )


def wavy(seed: int, n: int = 101, ds: float = 0.25, start: float = 1.0) -> Road:
    rng = np.random.default_rng(seed)
    s = ds * np.arange(n)
    bound = np.full(n, 2.5)
    for _ in range(3):
        bound += rng.uniform(0.0, 0.6) * np.sin(s / rng.uniform(0.8, 4.0) + rng.uniform(0.0, 6.3))
    if seed % 3 == 0:
        bound[n // 3] = 0.7
    return road(n, ds, bound=np.maximum(bound, 0.4), accel_max=1.0 + 0.3 * np.sin(s), start=start)


def moving(speed_sq: np.ndarray) -> np.ndarray:
    return speed_sq[1:] + speed_sq[:-1] > 1e-9


def travel_time(speed_sq: np.ndarray, ds: np.ndarray) -> float:
    v, go = np.sqrt(speed_sq), moving(speed_sq)
    return float((2.0 * ds[go] / (v[1:] + v[:-1])[go]).sum())


def excesses(p: SmoothingProblem, speed_sq: np.ndarray) -> dict[str, float]:
    """Largest violation of each exact constraint; negative is slack."""
    accel = np.diff(speed_sq) / (2.0 * p.ds)
    v, go = np.sqrt(speed_sq), moving(speed_sq)
    time = np.full_like(p.ds, np.inf)
    time[go] = (2.0 * p.ds)[go] / (v[1:] + v[:-1])[go]
    change = np.abs(np.diff(accel)) / (0.5 * (time[1:] + time[:-1]))
    moving_both = go[1:] & go[:-1]
    return {
        "speed": float(np.max(speed_sq - p.speed_sq_max)),
        "negative": float(np.max(-speed_sq)),
        "accel": float(np.max((accel - p.accel_max)[go], initial=-1.0)),
        "decel": float(np.max((-accel - p.decel_max)[go], initial=-1.0)),
        "jerk": float(np.max(change[moving_both] - p.jerk, initial=-1.0)),
    }


def assert_exact(p: SmoothingProblem, speed_sq: np.ndarray) -> None:
    for name, excess in excesses(p, speed_sq).items():
        assert excess <= TOLERANCE, (name, excess)


def optimum(p: SmoothingProblem) -> float:
    """The fastest profile under the exact constraints, by an interior point method."""
    top = p.speed_sq_max
    idle = np.flatnonzero(top[1:] <= 1e-9)
    n = int(idle[0]) + 2 if len(idle) else len(top)
    top, ds = top[:n], p.ds[: n - 1]
    problem = ca.Opti()
    v = problem.variable(n)
    y = v**2
    time = 2.0 * ds / (v[1:] + v[:-1])
    accel = (y[1:] - y[:-1]) / (2.0 * ds)
    change, between = accel[1:] - accel[:-1], 0.5 * (time[1:] + time[:-1])
    problem.minimize(ca.sum1(time))
    problem.subject_to(problem.bounded(0.0, v, np.sqrt(top)))
    problem.subject_to(v[0] == np.sqrt(top[0]))
    problem.subject_to(accel <= p.accel_max[: n - 1])
    problem.subject_to(accel >= -p.decel_max[: n - 1])
    if p.start_accel is not None:
        reach = p.jerk * ds[0] / np.sqrt(top[0])
        problem.subject_to(problem.bounded(-reach, accel[0] - p.start_accel, reach))
    problem.subject_to(change <= p.jerk * between)
    problem.subject_to(-change <= p.jerk * between)
    problem.set_initial(v, np.maximum(0.8 * np.sqrt(top), 0.05))
    quiet = {"print_level": 0, "sb": "yes", "max_iter": 1000}
    problem.solver("ipopt", {"print_time": 0}, quiet)
    return float(problem.solve().value(ca.sum1(time)))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("jerk", "share"), [(1.0, 0.01), (2.0, 0.005), (4.0, 0.005)])
def test_exact_constraints_hold_and_the_time_is_close_to_the_optimisers(
    seed: int, jerk: float, share: float
) -> None:
    p = problem_of(wavy(seed, start=0.0 if seed % 2 else 1.0), jerk)
    result = smooth(p)
    assert result.reason == ""
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    time, best = travel_time(result.speed_sq, p.ds), optimum(p)
    assert time <= best * (1.0 + share)
    assert time >= best * (1.0 - 1e-3)


def test_the_jerk_limit_bites() -> None:
    p = problem_of(wavy(0), 1.0)
    assert excesses(p, p.speed_sq_max)["jerk"] > 10.0
    result = smooth(p)
    assert result.speed_sq is not None
    assert travel_time(result.speed_sq, p.ds) > travel_time(p.speed_sq_max, p.ds)


def test_a_loose_jerk_limit_changes_nearly_nothing() -> None:
    p = problem_of(wavy(1), 1e4)
    result = smooth(p)
    assert result.speed_sq is not None
    np.testing.assert_allclose(result.speed_sq, p.speed_sq_max, atol=5e-3)


@pytest.mark.parametrize("ds", [0.05, 0.1, 0.5])
def test_spacing_does_not_matter(ds: float) -> None:
    n = round(20.0 / ds) + 1
    p = problem_of(wavy(3, n, ds), 2.0)
    result = smooth(p)
    assert result.speed_sq is not None, result.reason
    assert_exact(p, result.speed_sq)


def test_padding_at_rest_changes_nothing() -> None:
    p = problem_of(wavy(2, 101), 2.0)
    pad = 49
    padded = SmoothingProblem(
        np.pad(p.ds, (0, pad), constant_values=1.0),
        np.pad(p.speed_sq_max, (0, pad)),
        np.pad(p.accel_max, (0, pad)),
        np.pad(p.decel_max, (0, pad)),
        p.jerk,
    )
    plain, more = smooth(p), smooth(padded)
    assert plain.speed_sq is not None
    assert more.speed_sq is not None
    assert np.all(more.speed_sq[101:] == 0.0)
    assert_exact(p, more.speed_sq[:101])
    np.testing.assert_allclose(more.speed_sq[:101], plain.speed_sq, atol=2e-3)


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
    assert travel_time(result.speed_sq, p.ds) <= optimum(p) * 1.01


def test_tangents_far_from_the_answer_are_recomputed() -> None:
    """From rest, with little jerk: tangents at the time-optimal profile alone give 8 % away."""
    r = road(80, 0.25, bound=16.0, start=0.0, accel_max=0.92, scalars={"decel": 2.46})
    p = problem_of(r, 0.6)
    result = smooth(p)
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    assert travel_time(result.speed_sq, p.ds) <= optimum(p) * 1.01


def test_a_start_that_cannot_keep_the_jerk_limit_is_reported() -> None:
    """Full acceleration requested immediately where only braking is allowed."""
    r = road(41, 0.25, bound=np.linspace(2.0, 0.5, 41), start=2.0)
    p = problem_of(r, 0.5, start_accel=5.0)
    result = smooth(p)
    assert result.speed_sq is None
    assert "jerk limit" in result.reason


def test_where_nothing_is_feasible_it_says_so_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """OSQP would need all of its iterations to find nothing."""
    p = problem_of(wavy(5), 2.0)
    backwards = np.full(100, -1.0)
    impossible = SmoothingProblem(p.ds, p.speed_sq_max, backwards, backwards, p.jerk)
    monkeypatch.delattr(smoothing, "nearest_by_osqp")
    result = smooth(impossible)
    assert result.speed_sq is None
    assert "jerk limit" in result.reason


@pytest.mark.parametrize("seed", [0, 2, 5, 7])
def test_where_the_first_solver_fails_osqp_finds_a_profile_as_fast(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    p = problem_of(wavy(seed), 2.0, 0.3 if seed % 2 == 0 else None)
    first = smooth(p)
    monkeypatch.setattr(smoothing, "_along_stations", lambda *_: -1)
    second = smooth(p)
    assert first.speed_sq is not None
    assert second.speed_sq is not None
    assert second.iterations > first.iterations
    assert_exact(p, second.speed_sq)
    slower = travel_time(second.speed_sq, p.ds) / travel_time(first.speed_sq, p.ds)
    assert 1.0 - 1e-3 < slower < 1.02


def test_where_both_solvers_fail_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(smoothing, "_along_stations", lambda *_: -60)
    monkeypatch.setattr(smoothing, "_by_osqp", lambda *_: -100)
    result = smooth(problem_of(wavy(6), 2.0))
    assert result.speed_sq is None
    assert "160 iterations" in result.reason


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


def test_standing_candidates_stand() -> None:
    n = 60
    p = SmoothingProblem(np.full(n - 1, 0.25), np.zeros(n), np.ones(n - 1), np.ones(n - 1), 2.0)
    result = smooth(p)
    assert result.speed_sq is not None
    assert np.all(result.speed_sq == 0.0)


# ------------------------------------------------------------------------------ who is asked first

SOLVERS: tuple[Solver, ...] = get_args(Solver)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", [0, 3, 6])
def test_whoever_is_asked_first_is_exact_and_as_fast(solver: Solver, seed: int) -> None:
    p = problem_of(wavy(seed), 2.0, 0.3 if seed % 2 == 0 else None)
    result = smooth(p, solver)
    assert result.speed_sq is not None
    assert_exact(p, result.speed_sq)
    assert travel_time(result.speed_sq, p.ds) <= optimum(p) * 1.02


def test_each_solver_is_called_and_has_a_different_answer() -> None:
    p = problem_of(wavy(5), 2.0)
    answers = [smooth(p, solver) for solver in SOLVERS]
    assert len({a.iterations for a in answers}) == len(SOLVERS)
    exact = answers[SOLVERS.index("ipopt")]
    assert exact.speed_sq is not None
    assert travel_time(exact.speed_sq, p.ds) <= optimum(p) * 1.001


@pytest.mark.parametrize(
    ("solver", "name"), [("osqp", "_by_osqp"), ("ipopt", "_by_ipopt")], ids=["osqp", "ipopt"]
)
def test_where_the_chosen_solver_fails_the_default_one_answers(
    solver: Solver, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    p = problem_of(wavy(5), 2.0)
    monkeypatch.setattr(smoothing, name, lambda *_: -7)
    default, result = smooth(p), smooth(p, solver)
    assert default.speed_sq is not None
    assert result.speed_sq is not None
    np.testing.assert_array_equal(result.speed_sq, default.speed_sq)
    assert result.iterations == default.iterations + 7


@pytest.mark.parametrize("solver", SOLVERS)
def test_where_nothing_is_feasible_each_says_so(solver: Solver) -> None:
    r = road(41, 0.25, bound=np.linspace(2.0, 0.5, 41), start=2.0)
    assert smooth(problem_of(r, 0.5, start_accel=5.0), solver).speed_sq is None


@pytest.mark.parametrize("n", [2, 3, 31, 33])
def test_ipopt_accepts_candidates_of_any_length(n: int) -> None:
    p = SmoothingProblem(
        np.full(n - 1, 0.25),
        np.append(np.full(n - 1, 0.2), 0.0),
        np.ones(n - 1),
        np.ones(n - 1),
        4.0,
    )
    result = smooth(p, "ipopt")
    assert result.speed_sq is not None
    assert result.speed_sq.shape == (n,)
    assert_exact(p, result.speed_sq)
