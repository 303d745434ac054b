"""The nearest point under banded constraints, against closed forms and a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, minimize

from planner.banded_nearest import nearest

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]


def boxes(upper: np.ndarray) -> Rows:
    """x <= upper."""
    n = len(upper)
    first = np.minimum(np.arange(n), n - 3)
    rows = np.zeros((n, 3))
    rows[np.arange(n), np.arange(n) - first] = 1.0
    return first, rows, upper


def bends(n: int, most: float) -> Rows:
    """|x[k] − 2 x[k+1] + x[k+2]| <= most."""
    first = np.tile(np.arange(n - 2), 2)
    rows = np.repeat([[1.0, -2.0, 1.0], [-1.0, 2.0, -1.0]], n - 2, axis=0)
    return first, rows, np.full(2 * (n - 2), most)


def together(*parts: Rows) -> Rows:
    first, rows, limit = (np.concatenate(list(arrays)) for arrays in zip(*parts, strict=True))
    return first, rows, limit


def free(n: int) -> np.ndarray:
    return np.zeros(n, np.bool_)


def matrix(n: int, first: np.ndarray, rows: np.ndarray) -> np.ndarray:
    out = np.zeros((len(first), n))
    for i, k in enumerate(first):
        out[i, k : k + 3] += rows[i]
    return out


def test_without_constraints_it_is_the_point_itself() -> None:
    wanted = np.array([3.0, -1.0, 2.0, 5.0])
    first, rows, _ = boxes(wanted)
    found = nearest(wanted, free(4), first, rows, np.full(4, np.inf))
    np.testing.assert_array_equal(found, wanted)


def test_under_a_box_it_is_the_lower_of_both() -> None:
    wanted, upper = np.array([3.0, -1.0, 2.0, 5.0]), np.array([1.0, 1.0, 1.0, 7.0])
    found = nearest(wanted, free(4), *boxes(upper))
    np.testing.assert_allclose(found, np.minimum(wanted, upper), atol=1e-5)


def test_on_one_half_space_it_is_the_projection() -> None:
    wanted, normal = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, -1.0])
    found = nearest(wanted, free(3), np.zeros(1, np.int64), normal[None], np.array([-4.0]))
    projected = wanted - (normal @ wanted + 4.0) / (normal @ normal) * normal
    np.testing.assert_allclose(found, projected, atol=1e-5)


def test_fixed_stations_stay() -> None:
    wanted = np.array([0.0, 9.0, 9.0, 9.0, 9.0, 0.0])
    fixed = np.array([True, False, False, False, False, True])
    first, rows, limit = together(boxes(np.full(6, 9.0)), bends(6, 2.0))
    found = nearest(wanted, fixed, first, rows, np.where(np.arange(len(limit)) < 6, 20.0, limit))
    assert found is not None
    assert found[0] == found[-1] == 0.0
    assert np.abs(np.diff(found, 2)).max() <= 2.0 + 1e-5
    assert found[2] > 4.0


@settings(max_examples=40)
@given(st.integers(3, 30), st.integers(0, 10_000))
def test_it_agrees_with_a_general_solver(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted = rng.uniform(0.0, 4.0, n)
    first, rows, limit = together(boxes(wanted), bends(n, rng.uniform(0.05, 1.0)))
    found = nearest(wanted, free(n), first, rows, limit)
    assert found is not None
    a = matrix(n, first, rows)
    assert np.all(a @ found <= limit + 1e-5)
    other = minimize(
        lambda x: 0.5 * np.sum((x - wanted) ** 2), np.zeros(n), jac=lambda x: x - wanted,
        hess=lambda x: np.eye(n), method="trust-constr",
        constraints=LinearConstraint(a, -np.inf, limit), options={"gtol": 1e-9, "xtol": 1e-10},
    )  # fmt: skip
    mine = 0.5 * np.sum((found - wanted) ** 2)
    assert mine <= other.fun + 1e-4 * (1.0 + other.fun)


@pytest.mark.parametrize("limit", [-1.0, -1e-3])
def test_where_nothing_keeps_the_constraints_it_says_so(limit: float) -> None:
    """x <= limit and −x <= limit exclude each other."""
    first = np.zeros(2, np.int64)
    rows = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert nearest(np.ones(3), free(3), first, rows, np.full(2, limit)) is None


def test_numbers_that_are_none_are_no_answer() -> None:
    first, rows, limit = boxes(np.ones(4))
    assert nearest(np.array([1.0, np.nan, 1.0, 1.0]), free(4), first, rows, limit) is None
