"""Stations on the smooth curve of a polyline, compared with splines of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BSpline, make_interp_spline

from slopewise.planner.raw_polyline import arc
from slopewise.planner.smooth_path import _evenly, smooth


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 300), degree=st.integers(1, 3))
def test_stations_lie_evenly_on_the_spline(seed: int, count: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(degree + 1, 30))
    places = np.cumsum(rng.uniform([0.5, -0.4], [1.0, 0.4], (n, 2)), axis=0)
    length = float(rng.uniform(0.3, 3.0) * n)
    spline = make_interp_spline(np.linspace(0.0, length, n), places, k=degree)
    x, y = np.ascontiguousarray(spline.c.T)
    even = _evenly(spline.t, x, y, degree, length, count, places[0], places[-1])
    expected = by_scipy(spline, length, count)
    np.testing.assert_allclose(even, expected, atol=1e-9 * length)


def by_scipy(spline: BSpline, length: float, count: int) -> np.ndarray:
    """Uniform within the error of four chords per station, as the code states."""
    fine = np.linspace(0.0, length, 4 * count + 1)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(spline(fine), axis=0).T))))
    return spline(np.interp(np.linspace(0.0, along[-1], count), along, fine))


def test_a_curve_is_cut_into_pieces_of_one_length() -> None:
    turn = np.linspace(0.0, 2.0, 60)
    points = np.stack([8.0 * np.sin(turn), 5.0 * (1.0 - np.cos(turn))], axis=1)
    even = smooth(points, arc(points), 41, 0.0)
    chords = np.hypot(*np.diff(even, axis=0).T)
    np.testing.assert_allclose(chords, chords.mean(), rtol=2e-3)
    ellipse, _ = quad(lambda t: np.hypot(8.0 * np.cos(t), 5.0 * np.sin(t)), 0.0, 2.0)
    assert chords.sum() == pytest.approx(ellipse, rel=1e-3)


@pytest.mark.parametrize("length", [1.0, 4.0, 20.0])
def test_a_spline_does_not_swing_out_between_distant_vertices(length: float) -> None:
    points = np.array([[0.0, 0.0], [length, 0.0], [length, length], [2.0 * length, length]])
    even = smooth(points, arc(points), 400, 0.0)
    distance = np.minimum(
        np.minimum(np.abs(even[:, 1]), np.abs(even[:, 1] - length)), np.abs(even[:, 0] - length)
    )
    assert distance.max() < 0.15
    np.testing.assert_array_equal(even[[0, -1]], points[[0, -1]])
