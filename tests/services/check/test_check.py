"""Every rule bites: 10 % within it nothing is reported, 10 % beyond it the right kind is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from tests.services.check.drives import (
    ground,
    model_with,
    round_turn,
    slope,
    straight,
    trapezoid,
)

G = 9.80665


class Scene(NamedTuple):
    """A plan that uses a share of what one rule allows."""

    plan: ExternalPlan
    model: Model
    heights: ElevationMap
    clear: float = np.inf


def level_stop(speed: np.ndarray) -> np.ndarray:
    """Closed form of the quad's stop on level ground, v t_d + v²/2a + offset [m]."""
    decel = G * (0.015 * np.maximum(speed, 1.0) + 0.40)
    return np.where(speed > 0.0, 0.30 * speed + speed**2 / (2.0 * decel) + 0.20, 0.0)


def furthest(s: np.ndarray, speed: np.ndarray, share: float = 1.0) -> float:
    """Station before which stops end that use a share of the way they have [m]."""
    return float(np.max((s + level_stop(speed) / share)[speed > 0.0]))


def speed_limit(share: float) -> Scene:
    s, v = trapezoid(3.0 * share)
    return Scene(straight(s, v), model_with(limits={"speed": 3.0}), ground())


def trained_speed(share: float) -> Scene:
    s, v = trapezoid(3.0 * share)
    return Scene(straight(s, v), model_with(braking={"speed_range": [1.0, 3.0]}), ground())


def speed_driven_on_the_grade(share: float) -> Scene:
    """On 0.13 rad nothing faster than 2.5 m/s was driven, though 4 m/s on the level."""
    s, v = trapezoid(2.5 * share)
    hull = [[-0.26, 3.0], [0.0, 3.0], [0.26, 2.0]]
    return Scene(straight(s, v), model_with(braking={"speed_by_grade": hull}), ground(slope(0.13)))


def speed_limit_of_the_path(share: float) -> Scene:
    s, v = trapezoid(2.0 * share)
    return Scene(straight(s, v, speed_limit=np.full_like(s, 2.0)), model_with(), ground())


def stopping_path(share: float) -> Scene:
    s, v = trapezoid(3.0)
    front = 0.60 + 0.28  # the path has to be free for the front of the vehicle
    return Scene(straight(s, v), model_with(), ground(), furthest(s, v, share) + front)


def clear_distance(share: float) -> Scene:
    s, v = trapezoid(3.0)
    clear = np.full_like(s, furthest(s, v, share))
    return Scene(straight(s, v, clear_distance=clear), model_with(), ground())


def unknown_below_the_body(share: float) -> Scene:
    s, v = trapezoid(2.0)
    edge = 0.598 / share

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((y > edge + 0.025) & (x > 5.0), np.nan, 0.0)

    return Scene(straight(s, v), model_with(), ground(surface, resolution=0.05))


def unknown_where_a_stop_ends(share: float) -> Scene:
    s, v = trapezoid(3.0, decel=3.0)
    edge = furthest(s, v, share) + 0.60 + 0.28 + 0.05  # the front of the body, and a cell

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(x > edge, np.nan, 0.0 * y)

    return Scene(straight(s, v), model_with(), ground(surface, resolution=0.05))


def steeper_than_trained(share: float) -> Scene:
    s, v = trapezoid(1.0, accel=0.3)
    return Scene(straight(s, v), model_with(), ground(slope(0.26 * share)))


def more_roll_than_trained(share: float) -> Scene:
    s, v = trapezoid(1.0)
    model = model_with(braking={"roll_range": (-0.15, 0.15)})
    return Scene(straight(s, v), model, ground(slope(0.0, 0.15 * share)))


def tip_over(share: float) -> Scene:
    s, v = trapezoid(3.0)
    rear = 1.0 - 0.55 / 0.6 * (0.015 * 3.0 + 0.40)
    return Scene(straight(s, v), model_with(limits={"min_load": rear * share}), ground())


def front_axle_under_drive(share: float) -> Scene:
    s, v = trapezoid(1.0, accel=0.9, decel=0.1)
    # Uphill the front is light, and weak brakes leave the rear alone.
    model = model_with(
        braking={"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.25},
        limits={"min_load": share * (np.cos(0.2) - 0.55 / 0.6 * (np.sin(0.2) + 0.9 / G))},
    )
    return Scene(straight(s, v), model, ground(slope(0.2)))


def rollover(share: float) -> Scene:
    s, v = trapezoid(3.0)
    side, rear = 1.0 - 1.1 * 9.0 / (8.0 * G), 1.0 - 0.55 / 0.6 * 0.445
    model = model_with(limits={"min_load": (side + rear - 1.0) * share})
    return Scene(round_turn(s, v, 8.0), model, ground())


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rounded with a radius of 6 m, ±0.2 rad on both sides."""
    along = np.abs(x - 8.0)
    return -np.where(along < 1.2, along**2 / 12.0, 0.12 + 0.2 * (along - 1.2)) + 0.0 * y


def crest(share: float) -> Scene:
    s, v = trapezoid(3.0)
    return Scene(
        straight(s, v), model_with(limits={"min_load": 0.40 * share}), ground(hill, resolution=0.1)
    )


def dip(share: float) -> Scene:
    s, v = trapezoid(3.0)
    model = model_with(limits={"vertical_accel": 1.5 / share**3})
    return Scene(straight(s, v), model, ground(lambda x, y: -hill(x, y), resolution=0.1))


def lateral(share: float) -> Scene:
    s, v = trapezoid(np.sqrt(8.0 * share))
    return Scene(round_turn(s, v, 4.0), model_with(), ground())


def lateral_on_a_bank(share: float) -> Scene:
    """The turn leads straight downhill at first, and across the slope, which pushes outward."""
    s, v = trapezoid(np.sqrt(4.0 * 2.0 * share), length=3.0, stop_at=2.8, accel=20.0)
    bank = 0.05
    model = model_with(
        limits={"lateral_accel": 2.0 + G * np.sin(bank), "accel": 50.0, "decel": 50.0},
        vehicle={"max_drive_force": 50000.0, "max_drive_power": 500000.0},
    )
    return Scene(round_turn(s, v, 4.0), model, ground(slope(0.0, bank)))


def wheel_speed(share: float) -> Scene:
    s, v = trapezoid(2.0)
    model = model_with(vehicle={"max_wheel_speed": 2.0 * (1.0 + 0.5 * 1.15 / 4.0) / share})
    return Scene(round_turn(s, v, 4.0), model, ground())


def accel(share: float) -> Scene:
    s, v = trapezoid(2.0, accel=1.0 * share, decel=0.5)
    return Scene(straight(s, v), model_with(), ground())


def traction(share: float) -> Scene:
    s, v = trapezoid(2.0)
    needed = 500.0 * (0.9 + 0.13 * G)
    return Scene(straight(s, v), model_with(vehicle={"max_drive_force": needed / share}), ground())


def power(share: float) -> Scene:
    s, v = trapezoid(2.0)
    needed = 2.0 * 500.0 * (0.9 + 0.13 * G)
    return Scene(straight(s, v), model_with(vehicle={"max_drive_power": needed / share}), ground())


def decel(share: float) -> Scene:
    s, v = trapezoid(2.0, accel=0.5, decel=1.5 * share)
    return Scene(straight(s, v), model_with(), ground())


def brakes_downhill(share: float) -> Scene:
    s, v = trapezoid(2.0, accel=0.5, decel=share * G * (0.40 + 0.38 * 0.2 - np.sin(0.2)))
    model = model_with(braking={"m_m": 0.0, "b_m": -0.38, "m_b": 0.0}, limits={"decel": 9.0})
    return Scene(straight(s, v), model, ground(slope(-0.2)))


def friction(share: float) -> Scene:
    s, v = trapezoid(2.5)
    max_ratio = np.hypot(2.5**2 / 4.0, 0.9) / G
    model = model_with(braking={"sliding_friction": max_ratio / share})
    return Scene(round_turn(s, v, 4.0), model, ground())


def holding(share: float) -> Scene:
    s, v = trapezoid(1.0)
    force = np.sin(0.2) / share
    model = model_with(braking={"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": force})
    return Scene(straight(s, v), model, ground(slope(0.2)))


def holding_by_friction(share: float) -> Scene:
    s, v = trapezoid(0.5, accel=0.1)
    model = model_with(braking={"sliding_friction": np.tan(0.2) / share})
    return Scene(straight(s, v), model, ground(slope(0.2)))


def step(share: float) -> Scene:
    s, v = trapezoid(1.0)
    high = 0.28 / 3.0 * share**2
    return Scene(
        straight(s, v),
        model_with(),
        ground(lambda x, y: np.where(x > 8.0, high, 0.0 * y), resolution=0.05),
    )


def hole(share: float) -> Scene:
    s, v = trapezoid(1.0)
    deep = -0.28 / 3.0 * share**2

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 8.0) < 0.4) & (np.abs(y - 0.5) < 0.15), deep, 0.0)

    return Scene(straight(s, v), model_with(), ground(surface, resolution=0.05))


def clearance(share: float) -> Scene:
    s, v = trapezoid(1.0)

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 8.0) < 0.2) & (np.abs(y) < 0.2), 0.21 * share**2, 0.0)

    return Scene(straight(s, v), model_with(), ground(surface, resolution=0.05))


def body(share: float) -> Scene:
    s, v = trapezoid(1.0)

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 8.0) < 0.2) & (y > 0.59), 0.21 * share**2, 0.0)

    return Scene(straight(s, v), model_with(), ground(surface, resolution=0.05))


def stop_distance(share: float) -> Scene:
    s, v = trapezoid(3.0)
    return Scene(straight(s, v, stop_distance=level_stop(v) / share), model_with(), ground())


def rear_load(share: float) -> Scene:
    s, v = trapezoid(3.0)
    rear = 1.0 - 0.55 / 0.6 * (0.015 * np.maximum(v, 1.0) + 0.40)
    return Scene(straight(s, v, rear_load=rear * share), model_with(), ground())


def columns(share: float) -> Scene:
    s, v = trapezoid(3.0)
    stations = s * (1.1 if share > 1.0 else 1.001)
    return Scene(straight(s, v, station=stations), model_with(), ground())


SCENES: list[tuple[str, Callable[[float], Scene]]] = [
    ("speed_limit", speed_limit),
    ("speed_limit", trained_speed),
    ("speed_limit", speed_driven_on_the_grade),
    ("speed_limit", speed_limit_of_the_path),
    ("stopping_path", stopping_path),
    ("stopping_path", clear_distance),
    ("unknown_terrain", unknown_below_the_body),
    ("unknown_terrain", unknown_where_a_stop_ends),
    ("model_validity", steeper_than_trained),
    ("model_validity", more_roll_than_trained),
    ("tip_over", tip_over),
    ("tip_over", front_axle_under_drive),
    ("rollover", rollover),
    ("crest", crest),
    ("dip", dip),
    ("lateral", lateral),
    ("lateral", lateral_on_a_bank),
    ("wheel_speed", wheel_speed),
    ("accel", accel),
    ("traction", traction),
    ("traction", power),
    ("decel", decel),
    ("decel", brakes_downhill),
    ("friction", friction),
    ("holding", holding),
    ("holding", holding_by_friction),
    ("step", step),
    ("step", hole),
    ("clearance", clearance),
    ("body", body),
    ("stop_distance", stop_distance),
    ("rear_load", rear_load),
    ("columns", columns),
]


def kinds(scene: Scene) -> set[str]:
    report = check_plan_on_map(scene.plan, scene.model, scene.heights, clear=scene.clear)
    return {violation.kind for violation in report.violations}


@pytest.mark.parametrize(("kind", "scene"), SCENES, ids=[scene.__name__ for _, scene in SCENES])
def test_every_rule_bites(kind: str, scene: Callable[[float], Scene]) -> None:
    assert kind not in kinds(scene(0.9))
    assert kind in kinds(scene(1.12))


def test_every_kind_has_a_scene() -> None:
    assert {kind for kind, _ in SCENES} == set(TOLERANCES)


def test_a_sound_plan_has_no_violation() -> None:
    s, v = trapezoid(3.0, spacing=0.25)
    for surface in (None, slope(0.15), slope(-0.15), slope(0.0, 0.15), slope(-0.1, -0.1)):
        report = check_plan_on_map(straight(s, v), model_with(), ground(surface))
        assert report.valid, report.violations[:3]
        assert report.stops > 4 * np.count_nonzero(v) - 4


def test_violation_names_row_station_kind_and_size() -> None:
    s, v = trapezoid(3.0, begin=1.0)
    report = check_plan_on_map(straight(s, 1.2 * v), model_with(limits={"speed": 3.0}), ground())
    worst = report.worst()["speed_limit"]
    assert worst.candidate == "straight"
    assert worst.station == pytest.approx(s[worst.row], abs=0.1)
    assert worst.size == pytest.approx(0.6, abs=1e-6)
    assert worst.unit == "m/s"
    assert worst.sentence == "3.600 m/s where 3.000 m/s is the highest"
    rows = [violation.row for violation in report.violations]
    assert rows == sorted(rows)


def test_report_has_numbers_of_every_row() -> None:
    s, v = trapezoid(3.0)
    report = check_plan_on_map(straight(s, v), model_with(), ground())
    np.testing.assert_allclose(report.station, s, atol=1e-9)
    np.testing.assert_allclose(report.stop_distance, level_stop(v), atol=2e-4)
    moving = v > 0.0
    rear = 1.0 - 0.55 / 0.6 * (0.015 * np.maximum(v, 1.0) + 0.40)
    np.testing.assert_allclose(report.rear_load[moving], rear[moving], atol=1e-9)


def test_a_plan_that_does_not_rest_at_its_end_overruns_it() -> None:
    s, v = trapezoid(3.0)
    cut = straight(s[:100], v[:100])
    assert "stopping_path" in {
        x.kind for x in check_plan_on_map(cut, model_with(), ground()).violations
    }
    # A longer clear distance does not make the path longer.
    violations = check_plan_on_map(cut, model_with(), ground(), clear=30.0).violations
    assert "stopping_path" in {x.kind for x in violations}


def test_columns_are_not_needed_and_station_may_begin_anywhere() -> None:
    s, v = trapezoid(3.0)
    clear = furthest(s, v) + 0.05
    for first in (0.0, 5.0):
        plan = straight(s, v, station=s + first, clear_distance=np.full_like(s, clear + first))
        assert check_plan_on_map(plan, model_with(), ground()).valid
        plan = replace(plan, clear_distance=plan.clear_distance - 0.2)
        assert not check_plan_on_map(plan, model_with(), ground()).valid


def test_degraded_plans_may_brake_hard_from_a_start_that_is_too_fast() -> None:
    s, v = trapezoid(4.0, begin=4.0, decel=2.5, stop_at=3.2)
    model = model_with(limits={"speed": 3.0})
    assert {x.kind for x in check_plan_on_map(straight(s, v), model, ground()).violations} == {
        "decel",
        "speed_limit",
    }
    assert check_plan_on_map(straight(s, v, status="degraded"), model, ground()).valid


def test_infeasible_plans_are_not_checked_for_stops() -> None:
    s, v = trapezoid(4.0, begin=4.0, decel=4.0, stop_at=2.0)
    report = check_plan_on_map(
        straight(s, v, status="infeasible"), model_with(), ground(), clear=1.0
    )
    assert report.valid
    assert any("cannot be made safe" in note for note in report.notes)


def test_rows_at_one_place_count_once() -> None:
    s, v = trapezoid(3.0)
    s, v = np.repeat(s, 2), np.repeat(v, 2)
    v[21] = 9.0
    report = check_plan_on_map(straight(s, v), model_with(), ground())
    assert "speed_limit" in {x.kind for x in report.violations}


def test_coarse_maps_show_no_steps_and_the_report_notes_it() -> None:
    s, v = trapezoid(1.0)
    report = check_plan_on_map(straight(s, v), model_with(), ground(resolution=0.5))
    assert sum("steps were not checked" in note for note in report.notes) == 1


@pytest.mark.parametrize("decimals", [2, 3])
def test_rounded_positions_are_not_turns(decimals: int) -> None:
    s, v = trapezoid(2.5)
    plan = round_turn(s, v, 4.0)
    x, y = np.round(plan.x, decimals), np.round(plan.y, decimals)
    assert check_plan_on_map(replace(plan, x=x, y=y), model_with(), ground()).valid


def test_unusable_input_is_an_error() -> None:
    s, v = trapezoid(3.0)
    with pytest.raises(ParameterError, match="a first row on the map"):
        check_plan_on_map(straight(s + 500.0, v), model_with(), ground())
    with pytest.raises(ParameterError, match="clear: expected a distance"):
        check_plan_on_map(straight(s, v), model_with(), ground(), clear=-1.0)


def test_plan_at_rest_is_valid() -> None:
    report = check_plan_on_map(
        ExternalPlan(name="here", x=[1.0], y=[1.0], speed=[0.0]), model_with(), ground()
    )
    assert report.valid
    assert report.stops == 0


def test_plan_that_stops_at_its_start_is_at_rest() -> None:
    x, y = np.array([1.0, 1.0 + 1e-9]), np.ones(2)
    crawls = ExternalPlan(name="crawls", x=x, y=y, speed=np.array([6e-5, 0.0]))
    assert check_plan_on_map(crawls, model_with(), ground()).valid
    with pytest.raises(ParameterError, match="different places"):
        ExternalPlan(name="jumps", x=x, y=y, speed=np.array([6e-3, 0.0]))
