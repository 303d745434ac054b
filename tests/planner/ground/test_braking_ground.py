"""Braking force along candidates: the model, the surface, its effects.

Ground under the wheels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import braking as law
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import arc, ground_map, iced, plane, straight
from tests.world.stages import braking_ground_of, profile_of
from tests.world.vehicles import BASE, model_of, tables_with

_TABLES = ("vehicle", "terrain", "limits")
ICE = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.1}


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
    single = (
        ([("cross_slope", {"k": -0.2})], -0.2 * roll),
        ([("grade_asymmetry", {"k": 0.3})], 0.3 * grade),
        ([("grade_nonlinearity", {"k": -2.0})], -2.0 * grade**2),
        ([("directional_surface", {"k": 0.05, "direction": 0.3})], 0.05 * np.cos(0.6)),
    )
    together = [e for effects, _ in single for e in effects], sum(extra for _, extra in single)
    for effects, extra in (*single, together):
        _, ground = braking_ground_of(model_of(tables_with(*effects)), tilt)
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


WHEELBASE, TRACK = BASE.vehicle.wheelbase, BASE.vehicle.track_width


def along(ground: ElevationMap, *paths: CandidatePath, spacing: float = 0.25) -> TerrainProfile:
    return profile_of(BASE, ground, *paths, spacing=spacing)


@given(rise=st.floats(-0.6, 0.6), cross=st.floats(-0.6, 0.6), heading=st.floats(-3.2, 3.2))
def test_planes_are_exact_for_any_heading(rise: float, cross: float, heading: float) -> None:
    ground = plane(rise, cross, x=(-8.0, 8.0), y=(-8.0, 8.0))
    profile = along(ground, straight(5.0, heading))
    forward = np.array([np.cos(heading), np.sin(heading)])
    uphill = rise * forward[0] + cross * forward[1]
    assert profile.known.all()
    np.testing.assert_allclose(profile.grade, np.arctan(uphill), atol=1e-10)
    np.testing.assert_allclose(profile.sin_grade, np.sin(np.arctan(uphill)), atol=1e-10)
    # From the plane's normal, with no formula of the planner: left = up x forward.
    normal = np.array([-rise, -cross, 1.0]) / np.sqrt(1.0 + rise**2 + cross**2)
    tangent = np.array([*forward, uphill]) / np.sqrt(1.0 + uphill**2)
    left = np.cross(normal, tangent)
    np.testing.assert_allclose(np.cos(profile.grade) * np.sin(profile.roll), left[2], atol=1e-10)
    np.testing.assert_allclose(np.cos(profile.grade) * np.cos(profile.roll), normal[2], atol=1e-10)
    np.testing.assert_allclose(profile.sin_roll, np.sin(profile.roll), atol=1e-12)
    # Stations are counted in space.
    np.testing.assert_allclose(profile.station[-1], 5.0 * np.sqrt(1.0 + uphill**2), rtol=1e-12)
    np.testing.assert_allclose(
        profile.z[:, 0] - profile.z[0, 0], uphill * np.linspace(0.0, 5.0, len(profile.z)), atol=1e-9
    )


def test_grade_along_a_hill_converges_to_its_slope() -> None:
    def z(x: Any, y: Any) -> Any:
        return 2.0 * np.sin(x / 8.0)

    ground = ground_map(z, resolution=0.1)
    profile = along(ground, straight(30.0), spacing=0.1)
    slope = np.arctan(0.25 * np.cos(profile.x / 8.0))
    # Wheels 1.2 m apart see the chord: second order in the wheelbase; tyres rest on facets.
    assert np.abs(profile.grade - slope).max() < 2.0 * (WHEELBASE / 8.0) ** 2 / 24.0
    exact = np.trapezoid(np.sqrt(1.0 + np.tan(slope[:, 0]) ** 2), profile.x[:, 0])
    assert profile.station[-1, 0] == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("curvature", [-0.5, -0.05, 0.02, 0.3])
def test_curvature_is_the_circles_left_positive(curvature: float) -> None:
    angle = curvature * np.linspace(0.0, 4.0, 30)
    x = np.sin(angle)[:, None] / curvature
    y = (1.0 - np.cos(angle))[:, None] / curvature
    x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
    profile = terrain_profile(plane(), x, y, np.array([30]), BASE.vehicle)
    np.testing.assert_allclose(profile.curvature, curvature, rtol=1e-9)
    np.testing.assert_allclose(np.hypot(profile.heading_x, profile.heading_y), 1.0, rtol=1e-12)
    yaw = np.arctan2(profile.heading_y, profile.heading_x)[:, 0]
    np.testing.assert_allclose(yaw[1:-1], angle[1:-1], atol=1e-9)
    # The ends look along their only chord, which is off by half a step's turn.
    np.testing.assert_allclose(yaw[[0, -1]], angle[[0, -1]], atol=abs(curvature) * 4.0 / 29.0)


def unknown_disc(x0: float, y0: float, radius: float = 0.12) -> ElevationMap:
    return ground_map(
        lambda x, y: 0.0 * x, resolution=0.1, unknown=lambda x, y: np.hypot(x - x0, y - y0) < radius
    )


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_unknown_ground_under_one_wheel_only_is_seen_by_both_wheels_of_that_side(
    side: float,
) -> None:
    profile = along(unknown_disc(8.0, side * TRACK / 2.0), straight(16.0), spacing=0.1)
    x, known = profile.x[:, 0], profile.known[:, 0]
    lost = x[~known]
    front, rear = 8.0 - WHEELBASE / 2.0, 8.0 + WHEELBASE / 2.0
    assert np.all((np.abs(lost - front) < 0.35) | (np.abs(lost - rear) < 0.35))
    assert np.any(np.abs(lost - front) < 0.1)
    assert np.any(np.abs(lost - rear) < 0.1)
    assert known[np.argmin(np.abs(x - 8.0))]


def test_unknown_ground_under_the_path_is_used_but_not_between_path_and_wheels() -> None:
    centre = along(unknown_disc(8.0, 0.0), straight(16.0), spacing=0.1)
    assert not centre.known[np.argmin(np.abs(centre.x[:, 0] - 8.0)), 0]
    off_path = along(unknown_disc(8.0, 0.25, 0.06), straight(16.0), spacing=0.1)
    assert off_path.known.all()


def test_off_the_map_is_unknown() -> None:
    ground = plane(x=(-3.0, 10.0), y=(-6.0, 6.0))
    profile = along(ground, straight(12.0))
    x, known = profile.x[:, 0], profile.known[:, 0]
    np.testing.assert_array_equal(known, x + WHEELBASE / 2.0 <= 10.0)
    # A wheel over the edge is enough.
    path = CandidatePath("edge", np.array([(0.0, 5.6), (8.0, 5.6)]))
    assert not along(ground, path).known.any()


def test_unknown_heights_repeat_the_last_and_count_as_level() -> None:
    ground = plane(rise=0.2, unknown=lambda x, y: (x > 5.0) & (x < 7.0))
    profile = along(ground, straight(12.0))
    x, z, station = profile.x[:, 0], profile.z[:, 0], profile.station[:, 0]
    # The four cells around must be known: unknown begins a cell before.
    inside = (x > 5.0) & (x < 7.0)
    assert np.all(z[inside] == z[inside][0])
    assert np.all(np.isfinite(z))
    assert np.all(np.diff(station) >= np.diff(x) - 1e-12)
    assert np.all(profile.grade[~profile.known] == 0.0)


def tracks(profile: TerrainProfile, dense: int = 3000) -> tuple[np.ndarray, ...]:
    """Station and cell-free positions of path and wheels along the whole way, (dense, 5)."""
    s = np.linspace(0.0, profile.station[-1, 0], dense)
    yaw = np.unwrap(np.arctan2(profile.heading_y[:, 0], profile.heading_x[:, 0]))
    x, y, yaw = (
        np.interp(s, profile.station[:, 0], c) for c in (profile.x[:, 0], profile.y[:, 0], yaw)
    )
    wheels = [(0.0, 0.0), *((a, b) for a in (-0.6, 0.6) for b in (-0.5, 0.5))]
    ahead, sideways = np.array(wheels).T
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return s, x[:, None] + ahead * cos - sideways * sin, y[:, None] + ahead * sin + sideways * cos


@pytest.mark.parametrize("seed", range(12))
def test_no_wheel_rolls_over_an_unknown_or_icy_cell_between_stations(seed: int) -> None:
    """A line one cell wide across the way of a path in a turn."""
    rng = np.random.default_rng(seed)
    resolution = float(rng.choice([0.05, 0.1, 0.2, 0.25, 0.5]))
    place, normal = rng.uniform(2.0, 5.0), rng.uniform(-0.6, 0.6)
    curvature, heading = float(rng.choice([0.0, 0.3, 0.8, 1.0])), rng.uniform(-0.8, 0.8)

    def on_line(x: Any, y: Any) -> Any:
        return np.abs((x - place) * np.cos(normal) + y * np.sin(normal)) < 0.5 * resolution

    path = arc(2.5 / curvature, curvature, heading - 0.5) if curvature else straight(8.0, heading)
    extent = {"x": (-4.0, 12.0), "y": (-10.0, 10.0), "resolution": resolution}
    hidden = ground_map(lambda x, y: 0.0 * x, unknown=on_line, **extent)
    icy = ground_map(lambda x, y: 0.0 * x, classes=on_line, class_names=("", "ice"), **extent)
    spacing = PlannerSettings().spacing_on(resolution, BASE.vehicle)
    unknown, on_ice = along(hidden, path, spacing=spacing), along(icy, path, spacing=spacing)
    s, x, y = tracks(unknown)
    columns = np.rint((x + 4.0) / resolution).astype(int)
    rows = np.rint((y + 10.0) / resolution).astype(int)
    station = unknown.station[:, 0]
    # A vehicle on such a cell is before or behind a station that has noted it.
    noted = ~unknown.known[:, 0], (on_ice.surfaces[:, 0] & 0b10) > 0
    for where in s[np.isnan(hidden.elevation[rows, columns]).any(axis=1)]:
        k = np.clip(np.searchsorted(station, where) - 1, 0, len(station) - 2)
        assert all(n[k] or n[k + 1] for n in noted), (where, resolution)


def test_all_classes_under_path_and_wheels_are_noted() -> None:
    ground = ground_map(
        lambda x, y: 0.0 * x,
        resolution=0.1,
        classes=lambda x, y: np.where(y > 0.25, 2, np.where(x > 8.0, 1, 0)),
        class_names=("", "grass", "ice"),
    )
    profile = along(ground, straight(16.0), spacing=0.1)
    x, bits = profile.x[:, 0], profile.surfaces[:, 0]
    assert np.all(bits & 0b100)  # the left wheels
    assert np.all(bits[x < 7.0] == 0b101)
    assert np.all(bits[x > 9.0] == 0b110)
    assert np.all(bits[np.abs(x - 8.0) < 0.4] == 0b111)
