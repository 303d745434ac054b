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
from slopewise.models.parameters import Model
from slopewise.planner.ground.braking_ground import BrakingGround, GroundConditions, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.path import batch
from tests.planner.scenes import ground_map, model_of, plane, straight, tables_with

ICE = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.1}


def ground_of(
    model: Model,
    elevation_map: ElevationMap,
    *paths: CandidatePath,
    spacing: float = 0.25,
    conditions: GroundConditions | None = None,
) -> tuple[TerrainProfile, BrakingGround]:
    side = batch(list(paths) or [straight(16.0)], spacing)
    v = model.vehicle
    profile = terrain_profile(elevation_map, side.x, side.y, side.count, v.wheelbase, v.track_width)
    return profile, ground_along(profile, model, elevation_map.class_names, conditions)


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
    _, ground = ground_of(model_of(tables), plane(rise=np.tan(grade)))
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
        _, ground = ground_of(model_of(tables), plane(rise=np.tan(grade)))
        np.testing.assert_allclose(ground.lower_intercept, b_m * grade + 0.40, atol=1e-9)
        np.testing.assert_allclose(ground.lower_slope, m_m * grade + 0.015, atol=1e-9)


def test_a_lower_brake_level_leaves_the_rolling_resistance() -> None:
    tables = tables_with(braking={"level": 0.5})
    _, ground = ground_of(model_of(tables), plane())
    expected = law.force_ratio_at_level(0.40, 0.13, 0.5)
    np.testing.assert_allclose(ground.lower_intercept, expected, rtol=1e-12)
    np.testing.assert_allclose(ground.lower_slope, 0.5 * 0.015, rtol=1e-12)


def test_a_lasting_change_scales_and_shifts_the_force() -> None:
    tables = tables_with(("step_change", {"scale": 0.8, "delta": -0.03}))
    _, ground = ground_of(model_of(tables), plane())
    np.testing.assert_allclose(ground.lower_intercept, 0.8 * 0.40 - 0.03, rtol=1e-12)
    np.testing.assert_allclose(ground.lower_slope, 0.8 * 0.015, rtol=1e-12)


# --------------------------------------------------------------------------------- surfaces


def test_ice_holds_from_the_station_before_it_to_the_one_after() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {"ice": ICE}
    profile, ground = ground_of(model_of(tables), iced(), spacing=0.2)
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
    _, ground = ground_of(model, strange)
    np.testing.assert_allclose(ground.lower_intercept, 0.1)
    np.testing.assert_allclose(ground.lower_slope, 0.0, atol=1e-12)
    np.testing.assert_allclose(ground.upper_intercept, 0.7)
    np.testing.assert_allclose(ground.dead_time, 0.5)
    np.testing.assert_allclose(ground.fastest, 2.0)
    np.testing.assert_allclose(ground.distance_offset, 0.4)


def test_dead_time_and_offset_are_those_of_the_surface() -> None:
    tables = tables_with()
    tables["braking"]["terrain"] = {"ice": ICE | {"dead_time": 0.5, "distance_offset": 0.7}}
    profile, ground = ground_of(model_of(tables), iced(), spacing=0.2)
    x = profile.x[:, 0]
    assert np.all(ground.dead_time[(x > 8.0) & (x < 12.0), 0] == 0.5)
    assert np.all(ground.dead_time[(x < 7.0) | (x > 13.2), 0] == 0.3)
    # The offset is one for the candidate, its largest.
    np.testing.assert_array_equal(ground.distance_offset, [0.7])


def test_where_surfaces_differ_in_their_slowest_speed_the_weaker_choice_counts() -> None:
    tables = tables_with(braking={"m_b": 0.02, "m_m": 0.0})
    tables["braking"]["terrain"] = {"ice": {"b_b": 0.2, "speed_range": [0.4, 4.0]}}
    _, ground = ground_of(
        model_of(tables), plane(classes=lambda x, y: np.ones_like(x), class_names=("", "?"))
    )
    # Force grows with speed: the lower slowest speed holds the smaller force.
    np.testing.assert_array_equal(ground.slowest, 0.4)
    assert not ground.closed_form


# ------------------------------------------------------------------------- trained ranges


def test_ground_steeper_than_trained_is_marked() -> None:
    model = model_of(tables_with(braking={"grade_range": [-0.1, 0.2]}))
    for grade, trained in ((-0.11, False), (-0.09, True), (0.19, True), (0.21, False)):
        _, ground = ground_of(model, plane(rise=np.tan(grade)))
        assert np.all(ground.trained == trained), grade


def test_extrapolation_has_its_margin_both_ways_and_only_outside() -> None:
    tables = tables_with(
        braking={"grade_range": [-0.1, 0.1], "extrapolate": True, "extrapolation_margin": 0.2}
    )
    for grade, margin in ((-0.15, 0.2), (-0.05, 0.0), (0.15, 0.2)):
        _, ground = ground_of(model_of(tables), plane(rise=np.tan(grade)))
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
    profile, ground = ground_of(model_of(tables), ground_map(bowl), straight(15.0), spacing=0.5)
    grade, rest = profile.grade[:, 0], ground.lower_intercept[:, 0]
    k = int(np.flatnonzero(grade < -0.15)[0]) - 1
    for share in np.linspace(0.0, 1.0, 11):
        theta = grade[k] + share * (grade[k + 1] - grade[k])
        if theta < -0.15:
            exact = 0.6 * (-0.35 * theta + 0.40)
            assert rest[k] + share * (rest[k + 1] - rest[k]) <= exact + 1e-6


# ----------------------------------------------------------------------------------- effects


def test_ground_terms_are_added_where_they_act() -> None:
    tilt = plane(rise=0.1, cross=0.1)
    _, plain = ground_of(model_of(tables_with()), tilt)
    roll, grade = np.arctan(0.1 / np.sqrt(1.01)), np.arctan(0.1)
    for name, parameters, extra in (
        ("cross_slope", {"k": -0.2}, -0.2 * roll),
        ("grade_asymmetry", {"k": 0.3}, 0.3 * grade),
        ("grade_nonlinearity", {"k": -2.0}, -2.0 * grade**2),
        ("directional_surface", {"k": 0.05, "direction": 0.3}, 0.05 * np.cos(0.6)),
    ):
        _, ground = ground_of(model_of(tables_with((name, parameters))), tilt)
        np.testing.assert_allclose(ground.lower_intercept, plain.lower_intercept + extra, atol=1e-9)
        np.testing.assert_allclose(ground.upper_intercept, plain.upper_intercept + extra, atol=1e-9)


def test_a_weak_patch_starts_a_station_early_and_a_strong_one_for_tipping_only() -> None:
    for delta in (-0.2, 0.2):
        patch = ("surface_patch", {"delta": delta, "x": 8.0, "y": 0.0, "radius": 1.0})
        profile, ground = ground_of(model_of(tables_with(patch)), plane())
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


def test_drift_needs_the_time_of_the_session_and_fade_its_heat() -> None:
    model = model_of(
        tables_with(("session_drift", {"k": -1e-4}), ("brake_fade", {"k": 0.01, "tau": 60.0}))
    )
    _, cold = ground_of(model, plane())
    _, late = ground_of(
        model, plane(), conditions=GroundConditions(session_time=600.0, brake_heat=30.0)
    )
    np.testing.assert_allclose(late.lower_intercept, cold.lower_intercept - 0.06, atol=1e-12)
    assert (cold.motion.heat, late.motion.heat) == (0.0, 30.0)


def test_a_closed_form_is_claimed_only_without_motion_terms() -> None:
    harmless = ("cross_slope", {"k": 0.1})
    assert ground_of(model_of(tables_with()), plane())[1].closed_form
    assert ground_of(model_of(tables_with(harmless)), plane())[1].closed_form
    for effect in (
        ("aerodynamic_drag", {"c": 0.01}),
        ("headwind", {"c": 0.01, "wind": 3.0, "direction": 0.0}),
        ("viscous_resistance", {"c": 0.01}),
        ("turning_resistance", {"k": 0.01}),
        ("brake_lag", {"tau": 0.1}),
        ("brake_fade", {"k": 0.01, "tau": 60.0}),
    ):
        assert not ground_of(model_of(tables_with(effect)), plane())[1].closed_form, effect
    # A cap is in the forces already: a constant where it binds.
    capped = tables_with(braking={"sliding_friction": 0.3})
    ground = ground_of(model_of(capped), plane())[1]
    assert ground.closed_form
    np.testing.assert_array_equal(ground.lower_slope, 0.0)
    np.testing.assert_allclose(ground.lower_intercept, 0.3)


def test_padding_stays_finite() -> None:
    _, ground = ground_of(model_of(tables_with()), plane(), straight(3.0), straight(12.0))
    for name in (
        "lower_slope",
        "lower_intercept",
        "upper_slope",
        "upper_intercept",
        "dead_time",
        "slowest",
    ):
        assert np.isfinite(getattr(ground, name)).all(), name
