"""Heights under the guard's wheels: means over a tyre where the map has an error."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.guard.guard_map import WheelHeights
from slopewise.services.physics.heights import height_of
from tests.world.vehicles import BASE

VEHICLE = BASE.vehicle
EAST, NORTH = np.meshgrid(0.1 * np.arange(120), 0.1 * np.arange(100))
X, Y = (np.random.default_rng(2).uniform(1.0, 8.0, 400) for _ in range(2))
Y = Y[::-1]


def ground(heights: Floats, std: float) -> ElevationMap:
    return ElevationMap(elevation=heights, resolution=0.1, origin=(0.0, 0.0), height_std=std)


def test_noise_is_a_fifth_and_a_slope_stays() -> None:
    slope = 0.3 * EAST - 0.2 * NORTH
    noisy = ground(slope + 0.03 * np.random.default_rng(1).standard_normal(EAST.shape), 0.03)
    error = WheelHeights(noisy, VEHICLE).at(X, Y) - (0.3 * X - 0.2 * Y)
    assert np.std(error) < 0.25 * 0.03
    exact = WheelHeights(ground(slope, 0.03), VEHICLE).at(X, Y)
    np.testing.assert_allclose(exact, 0.3 * X - 0.2 * Y, atol=1e-12)


def test_unknown_ground_stays_unknown_and_exact_maps_are_as_they_are() -> None:
    heights = 0.1 * np.sin(EAST) + 0.0 * NORTH
    heights[40:44, 40:44] = np.nan
    for std in (0.0, 0.03):
        felt = WheelHeights(ground(heights, std), VEHICLE).at(X, Y)
        there = height_of(ground(heights, std), X, Y)
        np.testing.assert_array_equal(np.isnan(felt), np.isnan(there))
        if std == 0.0:
            np.testing.assert_array_equal(felt, there)
    assert WheelHeights(ground(heights, 0.03), VEHICLE).at(X, Y) == pytest.approx(
        height_of(ground(heights, 0.03), X, Y), abs=0.02, nan_ok=True
    )


@pytest.mark.parametrize("heading", [1.0, -1.0])
def test_a_gap_between_two_rims_is_bridged_and_the_edge_of_a_drop_is_no_support(
    heading: float,
) -> None:
    gap = np.where(np.isclose(EAST, 5.0), -0.5, 0.0)
    drop = np.where(EAST > 5.05, -0.5, 0.0)
    place = np.array([5.0]), np.array([5.0]), np.array([heading]), np.array([0.0])
    sunk = 0.28 - np.sqrt(0.28**2 - 0.1**2)
    # Places of the rim that are checked lie a little beyond the edges of the gap.
    assert -0.05 < WheelHeights(ground(gap, 0.0), VEHICLE).contact(*place)[0] <= -sunk
    below = (place[0] + 0.12, *place[1:])
    assert WheelHeights(ground(drop, 0.0), VEHICLE).contact(*below) == pytest.approx(-0.5)
