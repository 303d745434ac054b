"""Polylines: cleaning, and the smooth curve through them."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BSpline, make_interp_spline

from slopewise.models.errors import ParameterError
from slopewise.planner import raw_polyline
from slopewise.planner.raw_polyline import arc, clean, without_noise
from slopewise.planner.smooth_path import _evenly, smooth

# ---------------------------------------------------------------------------- raw polyline


@given(seed=st.integers(0, 2**32 - 1))
def test_the_quick_check_overlooks_nothing(seed: int) -> None:
    """Every polyline that cleaning repairs or refuses is sent to it by the quick check."""
    rng = np.random.default_rng(seed)
    steps = rng.choice([2e-4, 1e-3, 0.3, 2.0], rng.integers(2, 12))
    turns = np.deg2rad(rng.choice([0.0, 40.0, 113.0, 119.0, 121.0, 170.0], len(steps)))
    headings = np.cumsum(turns * rng.choice([-1.0, 1.0], len(steps)))
    points = np.cumsum(steps[:, None] * np.stack([np.cos(headings), np.sin(headings)], 1), axis=0)
    limit = rng.uniform(0.0, 3.0, len(points))
    quick = outcome(points, limit)
    with patch.object(raw_polyline, "_needs_a_look", return_value=True):
        assert outcome(points, limit) == quick


def outcome(points: np.ndarray, limit: np.ndarray) -> object:
    try:
        cleaned, lowest = clean(points, limit, None)
    except ParameterError as error:
        return str(error)
    assert lowest is not None
    return cleaned.tolist(), lowest.tolist()


def test_a_valid_polyline_is_not_cleaned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(raw_polyline, "_CUSP", -1.0)  # A thorough look would refuse it.
    points = np.stack([np.linspace(0.0, 20.0, 100), np.zeros(100)], axis=1)
    cleaned, _ = clean(points, None, None)
    np.testing.assert_array_equal(cleaned, points)
    cleaned[0] = 7.0
    assert points[0, 0] == 0.0


def test_noise_is_averaged_until_segments_point_ahead() -> None:
    rng = np.random.default_rng(3)
    along = np.arange(0.0, 40.0, 0.05)
    points = np.stack([along, np.zeros_like(along)], axis=1)
    points += 0.05 * rng.normal(size=points.shape)
    cleaned, distance, outliers = without_noise(points, arc(points))
    headings = np.arctan2(*np.diff(cleaned, axis=0).T[::-1])
    assert np.abs(headings[1:-1]).max() < 0.5
    assert distance[-1] == pytest.approx(40.0, rel=0.03)
    assert outliers < 0.05
    np.testing.assert_array_equal(cleaned[[0, -1]], points[[0, -1]])


# ----------------------------------------------------------------------------- smooth path


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
