"""Ground along a line: heights, slopes, stations, turns, and what is known."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.heights import classes_around, height_of
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import ground_under
from slopewise.services.check.plan_line import line_of
from tests.services.check.drives import ground, model_with, round_turn, slope, straight


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


def test_slopes_and_stations_on_a_plane() -> None:
    s = np.linspace(0.0, 20.0, 81)
    plan = straight(s, np.zeros_like(s))
    line = line_of(plan, 0.5)
    under = ground_under(ground(slope(0.2, -0.1)), line, model_with().vehicle)
    np.testing.assert_allclose(under.grade, 0.2, atol=1e-12)
    np.testing.assert_allclose(under.roll, -0.1, atol=1e-12)
    np.testing.assert_allclose(under.vertical_curvature, 0.0, atol=1e-9)
    np.testing.assert_allclose(under.station[line.at_row], s / np.cos(0.2), atol=1e-9)
    assert under.known.all()
    assert under.body_known.all()


def test_agrees_with_the_profile_of_the_planner_at_its_stations() -> None:
    """Two writings of the same ground, on a bumpy one and in a turn."""

    def bumps(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.3 * np.sin(x / 1.7) * np.cos(y / 2.3) + 0.05 * x

    heights, vehicle = ground(bumps), model_with().vehicle
    s = np.linspace(0.0, 12.0, 97)
    plan = round_turn(s, np.zeros_like(s), 6.0)
    line = line_of(plan, 0.0)
    under = ground_under(heights, line, vehicle)
    profile = terrain_profile(
        heights,
        plan.x[:, None],
        plan.y[:, None],
        np.array([len(s)]),
        vehicle.wheelbase,
        vehicle.track_width,
    )
    rows = line.at_row
    for checked, planned, atol in (
        (under.station, profile.station, 1e-9),
        (under.grade, profile.grade, 2e-3),
        (under.roll, profile.roll, 2e-3),
        (line.curvature, profile.curvature, 1e-3),
    ):
        np.testing.assert_allclose(checked[rows][1:-1], planned[1:-1, 0], atol=atol)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
def test_curvature_sees_past_noise(noise: float) -> None:
    rng = np.random.default_rng(1)
    s = np.linspace(0.0, 15.0, 151)
    turn = round_turn(s, np.zeros_like(s), 5.0)
    x, y = turn.x + rng.normal(0.0, noise, len(s)), turn.y + rng.normal(0.0, noise, len(s))
    line = line_of(ExternalPlan(name="noisy", x=x, y=y, speed=np.zeros_like(s)), 0.0)
    np.testing.assert_allclose(line.curvature, 0.2, atol=2e-3 + 0.1 * (noise > 0.0))
    np.testing.assert_allclose(line.heading[line.at_row], s / 5.0, atol=1e-2 + 6.0 * noise)


def test_two_rows_are_a_straight_line() -> None:
    line = line_of(ExternalPlan(name="two", x=[0.0, 3.0], y=[0.0, 4.0], speed=[1.0, 0.0]), 0.0)
    np.testing.assert_allclose(line.heading, np.arctan2(4.0, 3.0))
    np.testing.assert_allclose(line.curvature, 0.0)


def test_classes_of_all_four_cells_around_a_point() -> None:
    heights = ground()
    classes = np.zeros_like(heights.elevation, np.int64)
    classes[50:, :] = 1
    heights = ground(terrain_class=classes, class_names=("", "ice"))
    touched = classes_around(heights, np.zeros(3), np.array([-0.3, -0.1, 0.1]))
    np.testing.assert_array_equal(touched, [[True, True, False], [False, True, True]])


@pytest.mark.parametrize(
    ("name", "surfaces"),
    [
        ("", {""}),
        ("ice", {"ice"}),
        ("#7", {"ice"}),
        ("#2", {"sand"}),
        ("#0", {""}),
        ("#1", {"", "ice", "sand"}),
        ("mud", {"", "ice", "sand"}),
    ],
)
def test_a_class_that_the_model_does_not_know_may_be_any(name: str, surfaces: set[str]) -> None:
    tables = {"ice": {"b_b": 0.2, "class_id": 7}, "sand": {"b_b": 0.3}}
    model: Model = model_with(braking={"terrain": tables})
    classes = np.ones_like(ground().elevation, np.int64)
    heights = ground(terrain_class=classes, class_names=("", name))
    s = np.linspace(0.0, 5.0, 21)
    line = line_of(straight(s, np.zeros_like(s)), 0.0)
    under = ground_under(heights, line, model.vehicle)
    brakes = path_force_along(model, under, line, heights.class_names)
    assert set(brakes.names) == surfaces
