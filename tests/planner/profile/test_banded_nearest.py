"""The smoothing program and its banded solver."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, linprog, minimize

from slopewise.planner.profile.banded_nearest import keeps_none, nearest, room
from slopewise.planner.profile.osqp_nearest import matrix_of, nearest_by_osqp
from slopewise.planner.profile.smoothing_program import SLOWEST, TIGHTER, mid_time, program

# -------------------------------------------------------------------------- banded nearest


Solver = Callable[..., int]
Rows = tuple[np.ndarray, np.ndarray, np.ndarray]
"""First station, coefficients and limit of each row."""

both_solvers = pytest.mark.parametrize("solver", [nearest, nearest_by_osqp])


def solved(solver: Solver, target: np.ndarray, fixed: np.ndarray, rows: Rows) -> np.ndarray | None:
    """The answer; None if infeasible."""
    return with_force(solver, target, fixed, rows)[0]


def with_force(
    solver: Solver, target: np.ndarray, fixed: np.ndarray, rows: Rows
) -> tuple[np.ndarray | None, np.ndarray]:
    dense, limit = by_kinds(rows, len(target))
    x, force = np.empty_like(target), np.zeros(limit.shape)
    return x if solver(target, fixed, dense, limit, x, force) > 0 else None, force


def by_kinds(rows: Rows, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows in the form of the solvers: equally many for each station, padded with zeros."""
    first, coefficients, limit = rows
    kind = np.array([np.sum(first[:i] == k) for i, k in enumerate(first)], np.int64)
    kinds = int(kind.max(initial=-1)) + 1
    dense, limits = np.zeros((kinds, 3, n)), np.ones((kinds, n))
    for i, k in enumerate(first):
        dense[kind[i], :, k], limits[kind[i], k] = coefficients[i], limit[i]
    return dense, limits


def boxes(upper: np.ndarray) -> Rows:
    """x <= upper."""
    n = len(upper)
    first = np.minimum(np.arange(n), n - 3)
    rows = np.zeros((n, 3))
    rows[np.arange(n), np.arange(n) - first] = 1.0
    return first, rows, upper


def curvature_rows(n: int, max_curvature: float) -> Rows:
    """|x[k] − 2 x[k+1] + x[k+2]| <= most."""
    first = np.tile(np.arange(n - 2), 2)
    rows = np.repeat([[1.0, -2.0, 1.0], [-1.0, 2.0, -1.0]], n - 2, axis=0)
    return first, rows, np.full(2 * (n - 2), max_curvature)


def together(*parts: Rows) -> Rows:
    first, rows, limit = (np.concatenate(list(arrays)) for arrays in zip(*parts, strict=True))
    return first, rows, limit


def free(n: int) -> np.ndarray:
    return np.zeros(n, np.bool_)


def matrix(n: int, rows: Rows) -> np.ndarray:
    out = np.zeros((len(rows[0]), n))
    for i, k in enumerate(rows[0]):
        out[i, k : k + 3] += rows[1][i]
    return out


def test_without_constraints_it_is_the_point_itself() -> None:
    target = np.array([3.0, -1.0, 2.0, 5.0])
    nothing = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)
    np.testing.assert_array_equal(solved(nearest, target, free(4), nothing), target)


@both_solvers
def test_under_a_box_it_is_the_lower_of_both(solver: Solver) -> None:
    target, upper = np.array([3.0, -1.0, 2.0, 5.0]), np.array([1.0, 1.0, 1.0, 7.0])
    solution = solved(solver, target, free(4), boxes(upper))
    np.testing.assert_allclose(solution, np.minimum(target, upper), atol=2e-4)


@both_solvers
def test_on_one_half_space_it_is_the_projection(solver: Solver) -> None:
    target, normal = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, -1.0])
    rows = np.zeros(1, np.int64), normal[None], np.array([-4.0])
    solution, force = with_force(solver, target, free(3), rows)
    by = (normal @ target + 4.0) / (normal @ normal)
    np.testing.assert_allclose(solution, target - by * normal, atol=2e-4)
    assert force[0, 0] == pytest.approx(by, abs=2e-4)


@both_solvers
def test_fixed_stations_stay(solver: Solver) -> None:
    target = np.array([0.0, 9.0, 9.0, 9.0, 9.0, 0.0])
    fixed = np.array([True, False, False, False, False, True])
    solution = solved(
        solver, target, fixed, together(boxes(np.full(6, 20.0)), curvature_rows(6, 2.0))
    )
    assert solution is not None
    assert solution[0] == solution[-1] == 0.0
    assert np.abs(np.diff(solution, 2)).max() <= 2.0 + 2e-4
    assert solution[2] > 4.0


@both_solvers
@settings(max_examples=40, deadline=None)
@given(st.integers(3, 30), st.integers(0, 10_000))
def test_it_agrees_with_a_general_solver(solver: Solver, n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    target = rng.uniform(0.0, 4.0, n)
    rows = together(boxes(target), curvature_rows(n, rng.uniform(0.05, 1.0)))
    solution = solved(solver, target, free(n), rows)
    assert solution is not None
    a = matrix(n, rows)
    assert np.all(a @ solution <= rows[2] + 2e-4)
    reference = minimize(
        lambda x: 0.5 * np.sum((x - target) ** 2),
        np.zeros(n),
        jac=lambda x: x - target,
        hess=lambda x: np.eye(n),
        method="trust-constr",
        constraints=LinearConstraint(a, -np.inf, rows[2]),
        options={"gtol": 1e-9, "xtol": 1e-10},
    )
    mine = 0.5 * np.sum((solution - target) ** 2)
    assert mine <= reference.fun + 1e-3 * (1.0 + reference.fun)


def test_multipliers_are_the_gain_of_a_relaxed_constraint() -> None:
    """The derivative of the least distance over a limit is the force of its row."""
    target = np.random.default_rng(4).uniform(2.0, 4.0, 8)
    rows, fixed = together(boxes(target), curvature_rows(8, 0.2)), np.arange(8) == 0
    solution, force = with_force(nearest, target, fixed, rows)
    more = rows[0], rows[1], rows[2] + 1e-3
    freer = solved(nearest, target, fixed, more)
    assert solution is not None
    assert freer is not None
    gained = 0.5 * np.sum((solution - target) ** 2) - 0.5 * np.sum((freer - target) ** 2)
    assert 1e-3 * force.sum() == pytest.approx(gained, rel=0.05)
    dense, limit = by_kinds(more, 8)
    assert room(dense, limit, force, solution) == pytest.approx(gained, rel=0.05)


@pytest.mark.parametrize("limit", [-1.0, -1e-2])
@both_solvers
def test_where_nothing_keeps_the_constraints_it_says_so(solver: Solver, limit: float) -> None:
    """x <= limit and −x <= limit exclude each other."""
    first = np.zeros(2, np.int64)
    rows = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert solved(solver, np.ones(3), free(3), (first, rows, np.full(2, limit))) is None


@settings(max_examples=200, deadline=None)
@given(
    n=st.integers(3, 30),
    seed=st.integers(0, 2**20),
    max_curvature=st.sampled_from([0.01, 0.1, 1.0]),
)
def test_only_where_scipy_finds_nothing_multipliers_prove_it(
    n: int, seed: int, max_curvature: float
) -> None:
    """No multipliers prove infeasibility where there is a point; those of a failure
    prove it nearly always."""
    rng = np.random.default_rng(seed)
    upper = rng.uniform(0.5, 2.0, n)
    fixed = free(n)
    fixed[rng.integers(0, n, 2)] = True
    rows = together(boxes(upper), curvature_rows(n, max_curvature))
    there = linprog(
        np.zeros(n), matrix(n, rows), rows[2], bounds=np.column_stack((upper * fixed, upper))
    )
    dense, limit = by_kinds(rows, n)
    x, force = np.empty(n), np.zeros(limit.shape)
    solution = nearest(upper, fixed, dense, limit, x, force)
    proven = [
        keeps_none(upper, fixed, dense, limit, by)
        for by in (force, *rng.exponential(1.0, (20, *limit.shape)) ** 3)
    ]
    assert not (there.status == 0 and any(proven))
    if solution < 0 and there.status == 2:
        assert proven[0]


def test_numbers_that_are_none_are_no_answer() -> None:
    assert solved(nearest, np.array([1.0, np.nan, 1.0, 1.0]), free(4), boxes(np.ones(4))) is None


@given(st.integers(3, 12), st.integers(0, 10_000))
def test_general_solvers_get_the_same_rows(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = together(boxes(rng.uniform(0.0, 4.0, n)), curvature_rows(n, 1.0))
    dense, limit = by_kinds(rows, n)
    x = rng.normal(size=n)
    left = np.sort((limit.ravel() - matrix_of(dense) @ x)[dense.any(axis=1).ravel()])
    np.testing.assert_allclose(left, np.sort(rows[2] - matrix(n, rows) @ x))


# ----------------------------------------------------------------------- smoothing program


speeds_sq = st.floats(SLOWEST**2, 25.0)
lengths = st.floats(0.05, 1.0)
three = st.tuples(speeds_sq, speeds_sq, speeds_sq)
two = st.tuples(lengths, lengths)


def between(speed_sq: tuple[float, ...], ds: tuple[float, float]) -> float:
    """Time from the middle of one segment to that of the next, exactly."""
    u, v, w = np.sqrt(speed_sq)
    return float(ds[0] / (u + v) + ds[1] / (v + w))


@given(speed_sq=three, ds=two)
def test_the_tangent_is_that_of_automatic_differentiation(
    speed_sq: tuple[float, ...], ds: tuple[float, float]
) -> None:
    y = ca.SX.sym("y", 3)
    v = ca.sqrt(y)
    time = ds[0] / (v[0] + v[1]) + ds[1] / (v[1] + v[2])
    value_and_gradient = ca.Function("both", [y], [time, ca.gradient(time, y)])
    value, gradient = value_and_gradient(np.array(speed_sq))
    at_none, *slopes = mid_time(*speed_sq, *ds)
    np.testing.assert_allclose(slopes, np.asarray(gradient).ravel(), rtol=1e-9)
    assert at_none + np.dot(slopes, speed_sq) == pytest.approx(float(value), rel=1e-9)


@given(
    around=st.tuples(*[st.floats(0.0, 25.0)] * 3),
    speed_sq=st.tuples(*[st.floats(1e-6, 25.0)] * 3),
    ds=two,
)
def test_a_tangent_is_never_above_the_time(
    around: tuple[float, ...], speed_sq: tuple[float, ...], ds: tuple[float, float]
) -> None:
    """So what keeps a jerk limit written with the tangent keeps the exact one."""
    at_none, *slopes = mid_time(*around, *ds)
    assert at_none + np.dot(slopes, speed_sq) <= between(speed_sq, ds) * (1.0 + 1e-9)


def test_tangents_at_rest_are_finite() -> None:
    assert np.isfinite(mid_time(0.0, 0.0, 0.0, 0.25, 0.25)).all()


@given(
    n=st.integers(3, 9), seed=st.integers(0, 1000), start_accel=st.sampled_from([np.nan, -0.4, 0.7])
)
def test_rows_say_what_is_meant(n: int, seed: int, start_accel: float) -> None:
    """Worst of speed, acceleration and its change over the limits, by rows and by their meaning."""
    rng = np.random.default_rng(seed)
    ds, jerk = rng.uniform(0.1, 0.5, n - 1), rng.uniform(0.5, 4.0)
    top = rng.uniform(0.3, 4.0, n)
    if seed % 2 == 0:
        top[-1] = 0.0
    accel_max, decel_max = rng.uniform(0.3, 2.0, (2, n - 1))
    fixed, rows, limit = program(ds, top, accel_max, decel_max, jerk, start_accel, top)
    np.testing.assert_array_equal(fixed[1:], top[1:] <= 0.0)
    assert fixed[0]
    x = np.where(fixed, top, top * rng.uniform(0.8, 1.0, n))
    there = rows.any(axis=1).ravel()
    by_rows = np.sort((matrix_of(rows) @ x - limit.ravel())[there])

    accel = np.diff(x) / (2.0 * ds)
    upper, lower = accel_max - TIGHTER, TIGHTER - decel_max
    if not np.isnan(start_accel):
        reach = jerk * ds[0] / np.sqrt(top[0])
        upper[0], lower[0] = min(upper[0], start_accel + reach), max(lower[0], start_accel - reach)
    tangents = [mid_time(*top[k : k + 3], ds[k], ds[k + 1]) for k in range(n - 2)]
    times = np.array([t[0] + np.dot(t[1:], x[k : k + 3]) for k, t in enumerate(tangents)])
    change = np.diff(accel)
    free = ~fixed
    meant = np.concatenate(
        (
            (x - (top - TIGHTER))[free],
            -x[free],
            accel - upper,
            lower - accel,
            change - jerk * times + 2.0 * TIGHTER,
            -change - jerk * times + 2.0 * TIGHTER,
        )
    )
    np.testing.assert_allclose(by_rows, np.sort(meant), atol=1e-9)
