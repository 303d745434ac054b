"""Tangents of the time between segments."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.symbolic import SLOWEST, time_model

N = 12


def between(speed_sq: np.ndarray, ds: np.ndarray) -> np.ndarray:
    """Time from the middle of one segment to that of the next, exactly."""
    v = np.sqrt(speed_sq)
    seconds = 2.0 * ds / (v[1:] + v[:-1])
    return 0.5 * (seconds[1:] + seconds[:-1])


speeds_sq = st.lists(st.floats(SLOWEST**2, 25.0), min_size=N, max_size=N).map(np.array)
lengths = st.lists(st.floats(0.05, 1.0), min_size=N - 1, max_size=N - 1).map(np.array)


@given(speed_sq=speeds_sq, ds=lengths)
def test_the_value_is_the_time(speed_sq: np.ndarray, ds: np.ndarray) -> None:
    np.testing.assert_allclose(time_model(speed_sq, ds).between, between(speed_sq, ds), rtol=1e-9)


@given(speed_sq=speeds_sq, ds=lengths)
def test_the_gradient_is_that_of_finite_differences(speed_sq: np.ndarray, ds: np.ndarray) -> None:
    model = time_model(speed_sq, ds)
    for i in range(3):
        step = 1e-5 * speed_sq
        for m in range(N - 2):
            up, down = speed_sq.copy(), speed_sq.copy()
            up[m + i] += step[m + i]
            down[m + i] -= step[m + i]
            slope = (between(up, ds)[m] - between(down, ds)[m]) / (2.0 * step[m + i])
            assert model.between_gradient[i, m] == pytest.approx(slope, rel=1e-4)


@given(
    around=st.lists(st.floats(0.0, 25.0), min_size=N, max_size=N).map(np.array),
    speed_sq=st.lists(st.floats(1e-6, 25.0), min_size=N, max_size=N).map(np.array),
    ds=lengths,
)
def test_a_tangent_is_never_above_the_time(
    around: np.ndarray, speed_sq: np.ndarray, ds: np.ndarray
) -> None:
    """So what keeps a jerk limit written with the tangent keeps the exact one."""
    model = time_model(around, ds)
    change = speed_sq - around
    tangent = model.between + sum(
        model.between_gradient[i] * change[i : N - 2 + i] for i in range(3)
    )
    exact = between(speed_sq, ds)
    assert np.all(tangent <= exact * (1.0 + 1e-9))


def test_profiles_at_rest_are_finite() -> None:
    model = time_model(np.zeros(N), np.full(N - 1, 0.25))
    assert np.isfinite(model.between).all()
    assert np.isfinite(model.between_gradient).all()
