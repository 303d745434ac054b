"""Loads and friction against the laws of `models`, which checker and guard do not use; heights."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import wheel_loads, wheel_lockup
from slopewise.services.physics.heights import height_of
from slopewise.services.physics.loads import attitude_of, braking_cap, shares_of, utilisation
from tests.services.check.drives import model_with

G = 9.80665
VEHICLE = model_with().vehicle
FLAT = attitude_of(*(np.zeros(1) for _ in range(4)))


def poses(count: int = 200) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    return tuple(rng.uniform(-top, top, count) for top in (0.3, 0.3, 0.1, 0.2))


def test_loads_are_those_of_the_free_body() -> None:
    grade, roll, _, curvature = poses()
    even = np.zeros_like(grade)
    speed_sq, decel = np.linspace(0.0, 16.0, len(grade)), np.linspace(-1.0, 4.0, len(grade))
    shares = shares_of(VEHICLE, attitude_of(grade, roll, even, curvature), speed_sq, decel)
    lateral = speed_sq * curvature / np.cos(roll)
    v = VEHICLE
    rear = wheel_loads.rear_load_share(grade, roll, decel, v.wheelbase, v.cg_x, v.cg_z)
    front = wheel_loads.front_load_share(grade, roll, decel, v.wheelbase, v.cg_x, v.cg_z)
    sides = (
        wheel_loads.left_load_share(grade, roll, lateral, v.track_width, v.cg_z),
        wheel_loads.right_load_share(grade, roll, lateral, v.track_width, v.cg_z),
    )
    np.testing.assert_allclose(shares.rear, rear, atol=1e-12)
    np.testing.assert_allclose(shares.front, front, atol=1e-12)
    np.testing.assert_allclose(shares.side, np.minimum(*sides), atol=1e-12)
    wheels = wheel_loads.wheel_loads(
        1.0, -grade, roll, -decel, lateral, v.wheelbase, v.track_width, v.cg_x, v.cg_z
    )
    ahead = v.cg_x / v.wheelbase
    level = 0.5 * np.array([ahead, 1.0 - ahead, ahead, 1.0 - ahead])
    np.testing.assert_allclose(shares.wheel, np.min(wheels / level[:, None], axis=0), atol=1e-12)


def test_over_a_crest_all_lose_the_same_and_in_a_dip_nothing_is_gained() -> None:
    crest = FLAT._replace(vertical_curvature=np.array([-0.25]))
    speed_sq = np.array([9.0])
    zero = np.zeros(1)
    for share in shares_of(VEHICLE, crest, speed_sq, zero):
        assert share[0] == pytest.approx(1.0 - 0.25 * 9.0 / G)
    for share in shares_of(VEHICLE, crest, speed_sq, zero, crest=False):
        assert share[0] == pytest.approx(1.0)
    for share in shares_of(
        VEHICLE, FLAT._replace(vertical_curvature=np.array([0.25])), speed_sq, zero
    ):
        assert share[0] == pytest.approx(1.0)


def test_a_side_slope_leaves_less_for_the_brakes() -> None:
    """On 15° and μ = 0.35: 0.22 W, not 0.34 W."""
    pose = attitude_of(np.zeros(1), np.deg2rad(np.array([15.0])), np.zeros(1), np.zeros(1))
    left = braking_cap(VEHICLE, pose, np.array([0.35]), np.zeros(1))
    assert left[0] == pytest.approx(0.2176, abs=2e-4)
    assert utilisation(pose, np.array([0.35]), np.zeros(1), left)[0] == pytest.approx(1.0)


def test_axles_lock_where_the_law_says() -> None:
    v = model_with(vehicle={"front_brake_share": 0.55, "cg_x": 0.7}).vehicle
    for friction in (0.3, 0.6, 0.9):
        _, rear = wheel_lockup.lockup_force_ratios(
            0.0, 0.0, 0.55, friction, v.wheelbase, v.cg_x, v.cg_z
        )
        cap = braking_cap(v, FLAT, np.array([friction]), np.zeros(1))
        assert cap[0] == pytest.approx(min(rear, friction))
    # Wheels of a side that turn as one do not lock by axles.
    cap = braking_cap(VEHICLE, FLAT, np.array([0.6]), np.zeros(1))
    assert cap[0] == pytest.approx(0.6)


def test_heights_are_bilinear_and_unknown_next_to_unknown_cells() -> None:
    z = np.array([[0.0, 1.0, 2.0], [2.0, 3.0, np.nan]])
    heights = ElevationMap(elevation=z, resolution=0.5, origin=(1.0, 2.0))
    x, y = np.array([1.0, 1.25, 1.25, 1.75, 0.9, 2.0]), np.array([2.0, 2.0, 2.25, 2.25, 2.0, 2.0])
    height = height_of(heights, x, y)
    np.testing.assert_allclose(height, [0.0, 0.5, 1.5, np.nan, np.nan, 2.0 * np.nan])
    # On the rim itself, with all its cells known, ground is known.
    assert (
        height_of(heights, np.array([1.5]), np.array([2.5]))[0] != 3.0
    )  # a cell next to it is not
