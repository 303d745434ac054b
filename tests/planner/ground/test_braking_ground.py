"""Braking force along candidates: the model, the surface, its effects."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import braking as law
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import ground_map, plane, straight
from tests.world.plans import plan_one, violations
from tests.world.stages import braking_ground_of
from tests.world.vehicles import SMALL, model_of, tables_with

_TABLES = ("vehicle", "terrain", "limits")
ICE = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.1}


def iced(**options: Any) -> ElevationMap:
    """Ice from x = 8 m to 12 m."""
    return plane(
        resolution=0.1,
        classes=lambda x, y: (x >= 8.0) & (x <= 12.0),
        class_names=("", "ice"),
        **options,
    )


@given(
    grade=st.floats(-0.25, 0.25),
    speed=st.floats(0.0, 4.0),
    m_m=st.floats(-0.1, 0.1),
    b_m=st.floats(-0.6, 0.6),
    m_b=st.floats(-0.03, 0.03),
)
def test_force_is_the_law_on_any_plane(
    grade: float, speed: float, m_m: float, b_m: float, m_b: float
) -> None:
    tables = tables_with(braking={"m_m": m_m, "b_m": b_m, "m_b": m_b})
    _, ground = braking_ground_of(model_of(tables), plane(rise=np.tan(grade)))
    expected = law.force_ratio(grade, speed, m_m, b_m, m_b, 0.4)
    np.testing.assert_allclose(
        speed * ground.lower_slope + ground.lower_intercept, expected, atol=1e-9
    )
    np.testing.assert_array_equal(ground.lower_slope, ground.upper_slope)
    np.testing.assert_array_equal(ground.lower_intercept, ground.upper_intercept)
    assert ground.trained.all()


def test_uphill_has_its_own_slope_coefficients_and_downhill_keeps_the_others() -> None:
    tables = tables_with(braking={"uphill": {"m_m": 0.02, "b_m": 0.5}})
    for grade, m_m, b_m in ((0.2, 0.02, 0.5), (-0.2, -0.03, -0.35)):
        _, ground = braking_ground_of(model_of(tables), plane(rise=np.tan(grade)))
        np.testing.assert_allclose(ground.lower_intercept, b_m * grade + 0.40, atol=1e-9)
        np.testing.assert_allclose(ground.lower_slope, m_m * grade + 0.015, atol=1e-9)


def test_ice_holds_from_the_station_before_it_to_the_one_after() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {"ice": ICE}
    profile, ground = braking_ground_of(model_of(tables), iced(), spacing=0.2)
    x, rest = profile.x[:, 0], ground.lower_intercept[:, 0]
    # Front wheels reach it 0.6 m ahead of the path, one more station for a sharp edge.
    on_ice = (x >= 8.0 - 0.6 - 0.25) & (x <= 12.0 + 0.6 + 0.25)
    np.testing.assert_allclose(rest[on_ice], 0.1)
    np.testing.assert_allclose(rest[(x < 7.0) | (x > 13.2)], 0.40)
    # Half the wheels on it: it decides where the vehicle stops, the base whether it tips.
    edge = np.argmin(np.abs(x - 8.0))
    assert ground.upper_intercept[edge, 0] == pytest.approx(0.40)
    assert ground.upper_intercept[np.argmin(np.abs(x - 10.0)), 0] == pytest.approx(0.1)


def test_an_unknown_class_is_the_weakest_and_the_strongest_surface_there_is() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {
        "ice": ICE | {"dead_time": 0.5, "distance_offset": 0.4, "speed_range": [0.5, 2.0]},
        "rubber": {"b_b": 0.7},
    }
    model = model_of(tables)
    strange = plane(classes=lambda x, y: np.ones_like(x), class_names=("", "unknown name"))
    _, ground = braking_ground_of(model, strange)
    np.testing.assert_allclose(ground.lower_intercept, 0.1)
    np.testing.assert_allclose(ground.lower_slope, 0.0, atol=1e-12)
    # From the slowest trained speed of any surface on, as much as rubber has from its own.
    np.testing.assert_allclose(ground.slowest, 0.5)
    np.testing.assert_allclose(ground.upper_intercept, 0.7 + 0.015 * (1.0 - 0.5))
    np.testing.assert_allclose(ground.dead_time, 0.5)
    np.testing.assert_allclose(ground.fastest, 2.0)
    np.testing.assert_allclose(ground.distance_offset, 0.4)


def test_extrapolation_has_its_margin_both_ways_and_only_outside() -> None:
    tables = tables_with(
        braking={"grade_range": [-0.1, 0.1], "extrapolate": True, "extrapolation_margin": 0.2}
    )
    for grade, margin in ((-0.15, 0.2), (-0.05, 0.0), (0.15, 0.2)):
        _, ground = braking_ground_of(model_of(tables), plane(rise=np.tan(grade)))
        rest = -0.35 * grade + 0.40
        assert ground.trained.all()
        np.testing.assert_allclose(ground.lower_intercept, rest * (1.0 - margin), atol=1e-9)
        np.testing.assert_allclose(ground.upper_intercept, rest * (1.0 + margin), atol=1e-9)


def test_the_whole_margin_holds_from_the_edge_of_the_trained_range_on() -> None:
    """Force is linear between stations, so the margin must begin before the edge."""

    def bowl(x: Any, y: Any) -> Any:
        return -0.01 * x**2

    tables = tables_with(
        braking={"grade_range": [-0.15, 0.3], "extrapolate": True, "extrapolation_margin": 0.4}
    )
    profile, ground = braking_ground_of(
        model_of(tables), ground_map(bowl), straight(15.0), spacing=0.5
    )
    grade, rest = profile.grade[:, 0], ground.lower_intercept[:, 0]
    k = int(np.flatnonzero(grade < -0.15)[0]) - 1
    for share in np.linspace(0.0, 1.0, 11):
        theta = grade[k] + share * (grade[k + 1] - grade[k])
        if theta < -0.15:
            exact = 0.6 * (-0.35 * theta + 0.40)
            assert rest[k] + share * (rest[k + 1] - rest[k]) <= exact + 1e-6


def test_ground_terms_are_added_where_they_act() -> None:
    tilt = plane(rise=0.1, cross=0.1)
    _, plain = braking_ground_of(model_of(tables_with()), tilt)
    roll, grade = np.arctan(0.1 / np.sqrt(1.01)), np.arctan(0.1)
    for name, parameters, extra in (
        ("cross_slope", {"k": -0.2}, -0.2 * roll),
        ("grade_asymmetry", {"k": 0.3}, 0.3 * grade),
        ("grade_nonlinearity", {"k": -2.0}, -2.0 * grade**2),
        ("directional_surface", {"k": 0.05, "direction": 0.3}, 0.05 * np.cos(0.6)),
    ):
        _, ground = braking_ground_of(model_of(tables_with((name, parameters))), tilt)
        np.testing.assert_allclose(ground.lower_intercept, plain.lower_intercept + extra, atol=1e-9)
        np.testing.assert_allclose(ground.upper_intercept, plain.upper_intercept + extra, atol=1e-9)


def test_a_weak_patch_starts_a_station_early_and_a_strong_one_for_tipping_only() -> None:
    for delta in (-0.2, 0.2):
        patch = ("surface_patch", {"delta": delta, "x": 8.0, "y": 0.0, "radius": 1.0})
        profile, ground = braking_ground_of(model_of(tables_with(patch)), plane())
        x, weak, strong = (
            profile.x[:, 0],
            ground.lower_intercept[:, 0],
            ground.upper_intercept[:, 0],
        )
        inside, outside = np.abs(x - 8.0) <= 0.75, np.abs(x - 8.0) >= 1.3
        np.testing.assert_allclose(weak[inside], 0.40 + delta)
        np.testing.assert_allclose(strong[inside], 0.40 + delta)
        np.testing.assert_allclose(weak[outside][[0, -1]], 0.40)
        edge = np.abs(np.abs(x - 8.0) - 1.25) < 1e-9
        assert edge.sum() == 2
        np.testing.assert_allclose((weak if delta < 0.0 else strong)[edge], 0.40 + delta)
        np.testing.assert_allclose((strong if delta < 0.0 else weak)[edge], 0.40)


def test_below_the_trained_speeds_no_surface_is_counted_on_for_another() -> None:
    """A stop begins on one surface and ends on another, which was driven more slowly."""
    growing = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.1, "b_b": 0.25, "speed_range": [3.0, 4.0]}
    falling = {"m_b": -0.05, "b_b": 0.5, "speed_range": [1.0, 4.0]}
    tables = tables_with(braking=growing | {"dead_time": 0.1}, limits={"speed": 2.0, "jerk": 50.0})
    tables["braking"]["terrain"] = {"ice": {"speed_range": [0.1, 4.0]}, "sand": falling}
    _, ground = braking_ground_of(model_of(tables), iced())
    for speed in (0.0, 0.5, 2.0, 4.0):
        force = np.maximum(speed, ground.slowest) * ground.lower_slope + ground.lower_intercept
        assert force.max() <= 0.25 + 0.1 * max(speed, 3.0) + 1e-9
    plan = plan_one(tables, iced(), straight(15.0))
    assert "stop_distance" not in violations(plan, tables, iced())


@pytest.mark.parametrize("begin", [0.0, 0.1, 0.4])
def test_weak_brakes_do_not_count_on_the_mean_of_the_grades_at_stations(begin: float) -> None:
    """One cell slopes more than the others: between two stations it is steeper than at either."""
    weak = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.14}
    tables = tables_with(braking=SMALL["braking"] | weak, **{k: SMALL[k] for k in _TABLES})
    cells = ground_map(
        lambda x, y: -0.02 * x - 0.1 * np.clip(x - 5.0, 0.0, 1.0) + 0.0 * y,
        resolution=1.0,
        x=(-3.0, 20.0),
    )
    path = CandidatePath("straight", np.array([[begin, 0.0], [begin + 12.0, 0.0]]))
    plan = plan_one(tables, cells, path, PlannerSettings(spacing=0.5))
    assert "stop_distance" not in violations(plan, tables, cells)
