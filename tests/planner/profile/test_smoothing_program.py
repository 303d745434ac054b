"""The program of smoothing: tangents of the time between segments, and what its rows say."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.planner.profile.osqp_nearest import matrix_of
from slopewise.planner.profile.smoothing_program import SLOWEST, TIGHTER, mid_time, program

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
