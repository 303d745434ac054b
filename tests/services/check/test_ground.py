"""Ground along a line: heights, slopes, stations, turns, and what is known.

Stops against closed forms, the slow reference of `models`, and their own step halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.services.check import stop_integration
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import classes_around, ground_under
from slopewise.services.check.plan_line import line_of
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_integration import (
    StopEnds,
    StopStarts,
    nominal_stops,
    worst_case_stops,
)
from slopewise.services.physics.loads import BodyAttitude
from tests.services.check.drives import Surface, ground, model_with, round_turn, slope, straight


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
        heights, plan.x[:, None], plan.y[:, None], np.array([len(s)]), vehicle
    )
    rows = line.at_row
    for checked, planned, atol in (
        (under.station, profile.station, 1e-6),
        (under.grade, profile.grade, 1e-6),
        (under.roll, profile.roll, 1e-6),
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


@pytest.mark.parametrize(("wide", "reported"), [(0.01, True), (0.1, False), (0.1, True)])
def test_zigzag_is_driven_and_no_noise(wide: float, reported: bool) -> None:
    """Its curvature was that of a chord through all of it, 0 at any speed."""
    ahead, left = 0.1 * np.arange(60.0), wide * np.random.default_rng(1).choice([-0.5, 0.5], 60)
    x, y = ahead - left, ahead + left
    steps = np.hypot(np.diff(x), np.diff(y))
    turn = np.diff(np.arctan2(np.diff(y), np.diff(x)))
    curvature = np.pad(2.0 * turn / (steps[1:] + steps[:-1]), 1, mode="edge")
    plan = ExternalPlan(
        name="zigzag", x=x, y=y, speed=np.zeros(60), curvature=curvature if reported else None
    )
    line = line_of(plan, 0.0)
    np.testing.assert_allclose(line.curvature[line.at_row], curvature, atol=1e-9)


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


G = 9.80665
SPEEDS = np.array([0.5, 1.0, 2.0, 3.0, 4.0])


def field_of(model: Model, surface: Surface | None = None, size: float = 40.0) -> StopDynamics:
    heights = ground(surface, size=size)
    s = np.linspace(0.0, size - 5.0, 400)
    line = line_of(straight(s, np.zeros_like(s)), 0.0)
    under = ground_under(heights, line, model.vehicle)
    brakes = path_force_along(model, under, line, heights.class_names)
    return StopDynamics.along(model, line, under, brakes)


def stops_on(
    field: StopDynamics, station: float = 2.0, dead_time: float = 0.3
) -> tuple[StopEnds, StopEnds]:
    """Nominal and worst-case stops."""
    count = len(SPEEDS)
    starts = StopStarts(np.full(count, station), SPEEDS, np.full(count, dead_time), 1e3)
    return nominal_stops(field, starts), worst_case_stops(field, starts)


@pytest.mark.parametrize("grade", [-0.2, 0.0, 0.2])
def test_on_an_even_slope(grade: float) -> None:
    field = field_of(model_with(), slope(grade))
    held, worst = stops_on(field)
    onset = np.maximum(SPEEDS, 1.0)
    decel = G * ((-0.03 * onset - 0.35) * grade + 0.015 * onset + 0.40 + np.sin(grade))
    np.testing.assert_allclose(held.end - 2.0, 0.3 * SPEEDS + SPEEDS**2 / (2 * decel), atol=2e-4)
    rear = np.cos(grade) - 0.55 / 0.6 * (decel / G - np.sin(grade))
    np.testing.assert_allclose(held.min_loads[0], rear, atol=1e-6)
    assert held.ended.all()
    np.testing.assert_allclose(worst.end, held.end, atol=1e-12)


def test_a_drive_that_is_cut_downhill_gains_speed_in_the_dead_time() -> None:
    model = model_with(braking={"drive_in_dead_time": "either"})
    held, worst = stops_on(field_of(model, slope(-0.2)))
    gain = G * (np.sin(0.2) - 0.13) * 0.3
    onset = SPEEDS + gain
    coefficient = np.maximum(onset, 1.0)
    decel = G * ((-0.03 * coefficient - 0.35) * -0.2 + 0.015 * coefficient + 0.40 + np.sin(-0.2))
    ends = 0.3 * SPEEDS + 0.15 * gain + onset**2 / (2.0 * decel)
    np.testing.assert_allclose(worst.end - 2.0, ends, atol=3e-4)
    assert (worst.end > held.end).all()
    # Uphill, and where motion resistance holds it, nothing is gained.
    for grade in (0.2, -0.1):
        held, worst = stops_on(field_of(model, slope(grade)))
        np.testing.assert_allclose(worst.end, held.end, atol=1e-12)


EFFECTS: list[tuple[str, Mapping[str, Any]]] = [
    ("aerodynamic_drag", {"c": 0.03}),
    ("headwind", {"c": 0.02, "wind": -4.0, "direction": 0.0}),
    ("viscous_resistance", {"c": 0.02}),
    ("brake_lag", {"tau": 0.2}),
    ("brake_fade", {"k": 0.02, "tau": 20.0}),
    ("wheel_lockup", {"mu": 0.42}),
    ("grade_asymmetry", {"k": 0.2}),
    ("grade_nonlinearity", {"k": -0.4}),
    ("cross_slope", {"k": -0.2}),
    ("crest_unloading", {"k": 1.0}),
    ("surface_patch", {"delta": -0.1, "x": 4.0, "y": 0.0, "radius": 1.0}),
    ("directional_surface", {"k": -0.05, "direction": 0.0}),
    ("step_change", {"scale": 0.8, "delta": 0.02}),
]


def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Grades of ±8°, a lean of 4°."""
    return 0.14 * 4.0 * np.sin(x / 4.0) + 0.07 * y


@pytest.mark.parametrize("effect", EFFECTS, ids=[name for name, _ in EFFECTS])
def test_agrees_with_the_slow_reference(effect: tuple[str, Mapping[str, Any]]) -> None:
    name, parameters = effect
    model = model_with(effect=[{"name": name, "parameters": parameters}])
    field = field_of(model, waves)
    pose = BodyAttitude(*field.table[:5])
    grade, zero = np.arcsin(pose.sine), np.zeros_like(pose.sine)
    roll = np.arctan2(pose.cross_slope_ratio, pose.normal_ratio)
    x = np.linspace(0.0, 35.0, len(field.station))
    track = GroundTrack(field.station, grade, roll, zero, zero, x, zero, pose.vertical_curvature)
    held, _ = stops_on(field)
    for speed, end in zip(SPEEDS, held.end, strict=True):
        simulated = simulate_stop(model, track, float(speed), station=2.0)
        assert simulated.stopped
        atol = 0.03 if name == "surface_patch" else 4e-3
        assert end - 2.0 == pytest.approx(simulated.distance, abs=atol)


def test_halving_the_step_changes_nothing_that_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    field = field_of(model_with(), waves)
    coarse, _ = stops_on(field)
    monkeypatch.setattr(stop_integration, "TIME_STEP", 0.5 * stop_integration.TIME_STEP)
    fine, _ = stops_on(field)
    np.testing.assert_allclose(coarse.end, fine.end, atol=1e-3)
    np.testing.assert_allclose(coarse.min_loads[0], fine.min_loads[0], atol=2e-3)


def test_a_vehicle_that_does_not_stop_is_not_followed_for_ever() -> None:
    model = model_with(braking={"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.15})
    field = field_of(model, slope(-0.2))
    count = len(SPEEDS)
    starts = StopStarts(np.full(count, 2.0), SPEEDS, np.full(count, 0.3), give_up=10.0)
    stops = worst_case_stops(field, starts)
    assert not stops.ended.any()
    assert (stops.end > 10.0).all()


def test_lowest_force_of_all_touched_surfaces_is_used() -> None:
    model = model_with(braking={"terrain": {"ice": {"b_b": 0.2, "dead_time": 0.5}}})
    layers = ground(size=40.0)
    classes = np.zeros_like(layers.elevation, np.int64)
    classes[:50] = 1  # right of y = 0, where the right wheels are
    heights = ground(size=40.0, terrain_class=classes, class_names=("", "ice"))
    s = np.linspace(0.0, 35.0, 400)
    line = line_of(straight(s, np.zeros_like(s)), 0.0)
    under = ground_under(heights, line, model.vehicle)
    brakes = path_force_along(model, under, line, heights.class_names)
    field = StopDynamics.along(model, line, under, brakes)
    held, _ = stops_on(field, dead_time=float(brakes.dead_time[0]))
    onset = np.maximum(SPEEDS, 1.0)
    slow, fast = (G * (0.015 * onset + b_b) for b_b in (0.2, 0.40))
    np.testing.assert_allclose(held.end - 2.0, 0.5 * SPEEDS + SPEEDS**2 / (2 * slow), atol=2e-4)
    # What unloads the rear is the most that any of them gives.
    np.testing.assert_allclose(held.min_loads[0], 1.0 - 0.55 / 0.6 * fast / G, atol=1e-6)


def test_crests_banks_and_locked_axles_lengthen_worst_case_stops() -> None:
    crests, _ = stops_on(field_of(model_with(), waves))
    _, real = stops_on(field_of(model_with(), waves))
    assert (real.end[1:] > crests.end[1:]).all()
    slippery = model_with(braking={"sliding_friction": 0.42})
    nominal, real = stops_on(field_of(slippery, slope(0.0, 0.2)))
    left = np.sqrt((0.42 * np.cos(0.2)) ** 2 - np.sin(0.2) ** 2)
    np.testing.assert_allclose(real.end - 2.0, 0.3 * SPEEDS + SPEEDS**2 / (2 * G * left), atol=3e-4)
    assert (real.end > nominal.end).all()
