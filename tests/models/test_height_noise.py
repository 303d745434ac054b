"""The noise of a map is estimated from its heights, on any ground."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import estimated_noise, noise_of

EAST, NORTH = np.meshgrid(0.1 * np.arange(200), 0.1 * np.arange(120))
GROUNDS = {
    "level": 0.0 * EAST,
    "steep": 0.4 * EAST - 0.2 * NORTH + 2_000.0,
    "hills": 0.5 * np.sin(EAST / 2.0) * np.cos(NORTH / 3.0),
    "a terrace": np.where(EAST > 9.0, 0.5, 0.0),
}


@pytest.mark.parametrize("name", GROUNDS)
@pytest.mark.parametrize("std", [0.005, 0.03])
@pytest.mark.parametrize("unknown", [0.0, 0.02])
def test_white_noise_is_estimated(name: str, std: float, unknown: float) -> None:
    rng = np.random.default_rng(7)
    heights = GROUNDS[name] + std * rng.standard_normal(EAST.shape)
    heights[rng.random(EAST.shape) < unknown] = np.nan
    assert estimated_noise(heights) == pytest.approx(std, rel=0.06)


def test_little_ground_has_no_noise() -> None:
    assert estimated_noise(np.zeros((3, 3))) == 0.0
    assert estimated_noise(np.full((40, 40), np.nan)) == 0.0


@pytest.mark.parametrize(
    ("stated", "is_assumed", "expected"),
    [(0.05, False, 0.05), (0.0, False, 0.0), (0.05, True, 0.02), (0.01, True, 0.01)],
)
def test_a_stated_error_counts_and_an_assumed_one_is_a_limit(
    stated: float, is_assumed: bool, expected: float
) -> None:
    heights = 0.02 * np.random.default_rng(1).standard_normal(EAST.shape)
    ground = ElevationMap(
        elevation=heights,
        resolution=0.1,
        origin=(0.0, 0.0),
        height_std=stated,
        height_std_is_assumed=is_assumed,
    )
    assert noise_of(ground) == pytest.approx(expected, rel=0.06)
