"""Every rule bites: 10 % within it nothing is reported, 10 % beyond it the right kind is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from tests.services.check.drives import (
    Surface,
    ground,
    model_with,
    round_turn,
    slope,
    straight,
    trapezoid,
)

G = 9.80665
Columns = Callable[[np.ndarray, np.ndarray], dict[str, np.ndarray]]


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


def driven(
    top: float,
    surface: Surface | None = None,
    *,
    radius: float | None = None,
    resolution: float = 0.2,
    clear: float = np.inf,
    columns: Columns | None = None,
    shape: Mapping[str, float] = MappingProxyType({}),
    **tables: Mapping[str, Any],
) -> Scene:
    """A straight drive, or a left turn, with a model of changed tables.

    ``columns`` gives further columns of a plan by its stations and speeds, ``shape`` what is not
    the default of a trapezoid.
    """
    s, v = trapezoid(top, **shape)
    further = {} if columns is None else columns(s, v)
    plan = straight(s, v, **further) if radius is None else round_turn(s, v, radius, **further)
    return Scene(plan, model_with(**tables), ground(surface, resolution=resolution), clear)


def at(place: Surface, height: float) -> Surface:
    """Ground of one height, or unknown, where a condition holds, and level elsewhere."""
    return lambda x, y: np.where(place(x, y), height, 0.0)


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rounded with a radius of 6 m, ±0.2 rad on both sides."""
    along = np.abs(x - 8.0)
    return -np.where(along < 1.2, along**2 / 12.0, 0.12 + 0.2 * (along - 1.2)) + 0.0 * y


def lateral_on_a_bank(u: float) -> Scene:
    """The turn leads straight downhill at first, and across the slope, which pushes outward."""
    return driven(
        np.sqrt(4.0 * 2.0 * u),
        slope(0.0, 0.05),
        radius=4.0,
        shape={"length": 3.0, "stop_at": 2.8, "accel": 20.0},
        limits={"lateral_accel": 2.0 + G * np.sin(0.05), "accel": 50.0, "decel": 50.0},
        vehicle={"max_drive_force": 50000.0, "max_drive_power": 500000.0},
    )


def front_axle_under_drive(u: float) -> Scene:
    """Uphill the front is light, and weak brakes leave the rear alone."""
    front = np.cos(0.2) - 0.55 / 0.6 * (np.sin(0.2) + 0.9 / G)
    braking = constant_force(0.25)
    limits = {"min_load": u * front}
    return driven(1.0, slope(0.2), shape={"decel": 0.1}, braking=braking, limits=limits)


def rear_share(speed: np.ndarray | float) -> np.ndarray:
    """Rear load of the quad on level ground under full brakes, a share of the static one."""
    return 1.0 - 0.55 / 0.6 * (0.015 * np.maximum(speed, 1.0) + 0.40)


def constant_force(b_b: float, b_m: float = 0.0) -> dict[str, float]:
    return {"m_m": 0.0, "b_m": b_m, "m_b": 0.0, "b_b": b_b}


HARD, SOFT = trapezoid(3.0, decel=3.0), trapezoid(3.0)
FRONT = 0.60 + 0.28  # [m] of the vehicle ahead of its middle: the path has to be free for it
HULL = {"speed_by_grade": [[-0.26, 3.0], [0.0, 3.0], [0.26, 2.0]]}  # 2.5 m/s on 0.13 rad
NEEDED_FORCE = 500.0 * (0.9 + 0.13 * G)  # [N] that the drive has to give
BRAKES_DOWNHILL = G * (0.40 + 0.38 * 0.2 - np.sin(0.2))
SIDE = 1.0 - 1.1 * 9.0 / (8.0 * G)

SCENES: dict[str, tuple[str, Callable[[float], Scene]]] = {
    "speed limit": ("speed_limit", lambda u: driven(3.0 * u, limits={"speed": 3.0})),
    "trained speed": (
        "speed_limit",
        lambda u: driven(3.0 * u, braking={"speed_range": [1.0, 3.0]}),
    ),
    "speed driven on the grade": (
        "speed_limit",
        lambda u: driven(2.5 * u, slope(0.13), braking=HULL),
    ),
    "speed limit of the path": (
        "speed_limit",
        lambda u: driven(2.0 * u, columns=lambda s, _: {"speed_limit": np.full_like(s, 2.0)}),
    ),
    "clear path": (
        "stopping_path",
        lambda u: driven(3.0, clear=furthest(*SOFT, u) + FRONT),
    ),
    "clear distance": (
        "stopping_path",
        lambda u: driven(
            3.0, columns=lambda s, v: {"clear_distance": np.full_like(s, furthest(s, v, u))}
        ),
    ),
    "unknown below the body": (
        "unknown_terrain",
        lambda u: driven(
            2.0, at(lambda x, y: (y > 0.598 / u + 0.025) & (x > 5.0), np.nan), resolution=0.05
        ),
    ),
    "unknown where a stop ends": (
        "unknown_terrain",
        lambda u: driven(
            3.0,
            at(lambda x, _: x > furthest(*HARD, u) + FRONT + 0.05, np.nan),
            resolution=0.05,
            shape={"decel": 3.0},
        ),
    ),
    "steeper than trained": (
        "model_validity",
        lambda u: driven(1.0, slope(0.26 * u), shape={"accel": 0.3}),
    ),
    "more roll than trained": (
        "model_validity",
        lambda u: driven(1.0, slope(0.0, 0.15 * u), braking={"roll_range": (-0.15, 0.15)}),
    ),
    "tip over": ("tip_over", lambda u: driven(3.0, limits={"min_load": rear_share(3.0) * u})),
    "front axle under drive": ("tip_over", front_axle_under_drive),
    "rollover": (
        "rollover",
        lambda u: driven(3.0, radius=8.0, limits={"min_load": (SIDE + rear_share(3.0) - 1.0) * u}),
    ),
    "crest": ("crest", lambda u: driven(3.0, hill, resolution=0.1, limits={"min_load": 0.4 * u})),
    "dip": (
        "dip",
        lambda u: driven(
            3.0, lambda x, y: -hill(x, y), resolution=0.1, limits={"vertical_accel": 1.5 / u**3}
        ),
    ),
    "lateral": ("lateral", lambda u: driven(np.sqrt(8.0 * u), radius=4.0)),
    "lateral on a bank": ("lateral", lateral_on_a_bank),
    "wheel speed": (
        "wheel_speed",
        lambda u: driven(
            2.0, radius=4.0, vehicle={"max_wheel_speed": 2.0 * (1.0 + 0.5 * 1.15 / 4.0) / u}
        ),
    ),
    "accel": ("accel", lambda u: driven(2.0, shape={"accel": 1.0 * u, "decel": 0.5})),
    "traction": ("traction", lambda u: driven(2.0, vehicle={"max_drive_force": NEEDED_FORCE / u})),
    "power": (
        "traction",
        lambda u: driven(2.0, vehicle={"max_drive_power": 2.0 * NEEDED_FORCE / u}),
    ),
    "decel": ("decel", lambda u: driven(2.0, shape={"accel": 0.5, "decel": 1.5 * u})),
    "brakes downhill": (
        "decel",
        lambda u: driven(
            2.0,
            slope(-0.2),
            shape={"accel": 0.5, "decel": u * BRAKES_DOWNHILL},
            braking=constant_force(0.40, -0.38),
            limits={"decel": 9.0},
        ),
    ),
    "friction": (
        "friction",
        lambda u: driven(
            2.5,
            radius=4.0,
            braking={"sliding_friction": np.hypot(2.5**2 / 4.0, 0.9) / G / u},
        ),
    ),
    "holding": (
        "holding",
        lambda u: driven(1.0, slope(0.2), braking=constant_force(np.sin(0.2) / u)),
    ),
    "holding by friction": (
        "holding",
        lambda u: driven(
            0.5,
            slope(0.2),
            shape={"accel": 0.1},
            braking={"sliding_friction": np.tan(0.2) / u},
        ),
    ),
    "step": (
        "step",
        lambda u: driven(1.0, at(lambda x, _: x > 8.0, 0.28 / 3.0 * u**2), resolution=0.05),
    ),
    "hole": (
        "step",
        lambda u: driven(
            1.0,
            at(
                lambda x, y: (np.abs(x - 8.0) < 0.4) & (np.abs(y - 0.5) < 0.15),
                -0.28 / 3.0 * u**2,
            ),
            resolution=0.05,
        ),
    ),
    "clearance": (
        "clearance",
        lambda u: driven(
            1.0,
            at(lambda x, y: (np.abs(x - 8.0) < 0.2) & (np.abs(y) < 0.2), 0.21 * u**2),
            resolution=0.05,
        ),
    ),
    "body": (
        "body",
        lambda u: driven(
            1.0, at(lambda x, y: (np.abs(x - 8.0) < 0.2) & (y > 0.59), 0.21 * u**2), resolution=0.05
        ),
    ),
    "stop distance": (
        "stop_distance",
        lambda u: driven(3.0, columns=lambda _, v: {"stop_distance": level_stop(v) / u}),
    ),
    "rear load": (
        "rear_load",
        lambda u: driven(3.0, columns=lambda _, v: {"rear_load": rear_share(v) * u}),
    ),
    "columns": (
        "columns",
        lambda u: driven(3.0, columns=lambda s, _: {"station": s * (1.1 if u > 1.0 else 1.001)}),
    ),
}


def kinds(scene: Scene) -> set[str]:
    report = check_plan_on_map(scene.plan, scene.model, scene.heights, clear=scene.clear)
    return {violation.kind for violation in report.violations}


@pytest.mark.parametrize("name", SCENES)
def test_every_rule_bites(name: str) -> None:
    kind, scene = SCENES[name]
    assert kind not in kinds(scene(0.9))
    assert kind in kinds(scene(1.12))


def test_every_kind_has_a_scene() -> None:
    assert {kind for kind, _ in SCENES.values()} == set(TOLERANCES)


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
    np.testing.assert_allclose(report.rear_load[moving], rear_share(v)[moving], atol=1e-9)


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
