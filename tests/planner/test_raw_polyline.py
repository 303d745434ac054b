"""Repairs of polylines, and refusals."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.planner import raw_polyline
from slopewise.planner.raw_polyline import arc, clean, without_noise


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
