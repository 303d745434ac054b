"""Parameters of a model, noise of heights, and what is recent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slopewise.models.effects.registry import LAWS, motion, motion_deceleration, validate
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.height_noise import estimated_noise, noise_of
from slopewise.models.parameters import Effect
from slopewise.models.recent import Recent
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.surface_names import candidate_surfaces, number_names, resolve_class
from tests.world.vehicles import BASE

NEGATIVE = tuple(tuple(-1.0 * (i == j) for j in range(4)) for i in range(4))


@pytest.mark.parametrize(
    ("part", "changes", "field"),
    [
        ("vehicle", {"mass": -5.0}, "mass"),
        ("vehicle", {"mass": float("nan")}, "mass"),
        ("vehicle", {"cg_x": 1.3}, "cg_x"),
        ("vehicle", {"track_width": 0.0}, "track_width"),
        ("braking", {"dead_time": -0.1}, "dead_time"),
        ("braking", {"speed_range": (4.0, 1.0)}, "speed_range"),
        ("braking", {"grade_range": (0.1, 0.1)}, "grade_range"),
        ("braking", {"roll_range": (0.1, -0.1)}, "roll_range"),
        ("braking", {"grade_range": (-15.0, 15.0)}, "grade_range"),
        ("braking", {"roll_range": (-20.0, 20.0)}, "roll_range"),
        ("braking", {"speed_by_grade": ((-15.0, 4.0), (15.0, 4.0))}, "speed_by_grade"),
        (
            "braking",
            {"terrain": {"ice": SurfaceBraking(grade_range=(-10.0, 10.0))}},
            "terrain.ice.grade_range",
        ),
        ("braking", {"speed_error": -0.1}, "speed_error"),
        ("vehicle", {"width": 0.9}, "width"),
        ("vehicle", {"wheel_width": 0.0}, "wheel_width"),
        ("limits", {"vertical_accel": 0.0}, "vertical_accel"),
        ("braking", {"b_b": -0.2}, "b_b"),
        ("braking", {"covariance": ((1.0,),)}, "covariance"),
        ("braking", {"covariance": NEGATIVE}, "covariance"),
        ("braking", {"level": 0.0}, "level"),
        ("braking", {"terrain": {"ice": SurfaceBraking(b_b=-1.0)}}, "terrain.ice.b_b"),
        ("limits", {"min_load": 0.0}, "min_load"),
        ("limits", {"jerk": 0.0}, "jerk"),
        ("terrain", {"motion_resistance": -0.1}, "motion_resistance"),
    ],
)
def test_refused(part: str, changes: dict[str, Any], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        replace(getattr(BASE, part), **changes)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


def test_slip_track_is_at_least_the_track_width() -> None:
    with pytest.raises(ParameterError, match=r"terrain\.slip_track"):
        replace(BASE, terrain=replace(BASE.terrain, slip_track=0.9))


def test_a_surface_changes_only_what_its_table_names() -> None:
    braking = replace(BASE.braking, terrain={"ice": SurfaceBraking(b_b=0.1, dead_time=0.4)})
    ice = braking.on("ice")
    assert (ice.b_b, ice.dead_time, ice.m_b) == (0.1, 0.4, 0.015)
    assert braking.on("nowhere") == replace(braking, terrain={})
    # One with a speed range has no hull of the base.
    hulled = replace(braking, speed_by_grade=((-0.1, 1.0), (0.1, 2.0)))
    tables = {"mud": SurfaceBraking(speed_range=(0.5, 2.0)), "sand": SurfaceBraking(b_b=0.3)}
    mud, sand = (replace(hulled, terrain=tables).on(name) for name in tables)
    assert (mud.speed_by_grade, sand.speed_by_grade) == (None, hulled.speed_by_grade)


def test_sizes_that_are_left_out_follow_the_wheel_radius() -> None:
    bare = replace(BASE.vehicle, wheel_radius=0.3, track_width=1.0, wheelbase=1.2)
    shape = bare.shape
    assert shape[:-1] == pytest.approx((1.21, 0.9, 0.9, 0.225, 0.1, 0.1, 0.21))
    assert len(shape.assumed) == 6
    complete = replace(bare, width=1.5, front_overhang=0.0, ground_clearance=0.4, wheel_width=0.3)
    assert complete.shape.assumed == ("rear_overhang", "max_step", "wheel_travel")
    assert complete.shape[:4] == pytest.approx((1.5, 0.6, 0.9, 0.4))
    assert replace(bare, wheel_width=0.3).shape.width == pytest.approx(1.3)


def test_the_front_axle_brakes_by_its_static_load_by_default() -> None:
    steered = replace(BASE.vehicle, drive="ackermann", cg_x=0.3, wheelbase=1.2)
    assert steered.brake_share == pytest.approx(0.25)
    assert replace(steered, drive="skid_steer").brake_share is None
    assert replace(BASE.vehicle, front_brake_share=0.7).brake_share == 0.7


def test_rolls_are_trained_as_far_as_grades_by_default() -> None:
    braking = replace(BASE.braking, grade_range=(-0.3, 0.1), roll_range=None)
    assert braking.trained_roll == (-0.3, 0.3)
    complete = replace(
        braking, roll_range=(-0.1, 0.2), terrain={"ice": SurfaceBraking(roll_range=(0.0, 0.1))}
    )
    assert complete.trained_roll == (-0.1, 0.2)
    assert complete.on("ice").trained_roll == (0.0, 0.1)


@pytest.mark.parametrize("name", list(LAWS))
def test_every_effect_refuses_what_it_does_not_know(name: str) -> None:
    with pytest.raises(ParameterError, match=r"parameters\.nonsense"):
        validate(Effect(name=name, parameters={"nonsense": 1.0}))


def test_unknown_effects_and_unphysical_signs_are_refused() -> None:
    with pytest.raises(ParameterError, match="name"):
        validate(Effect(name="gremlins", parameters={}))
    with pytest.raises(ParameterError, match=r"parameters\.c"):
        validate(Effect(name="aerodynamic_drag", parameters={"c": -0.1}))
    with pytest.raises(ParameterError, match=r"parameters\.tau"):
        validate(Effect(name="brake_lag", parameters={}))


def test_motion_terms_add_up_and_states_stand_alone() -> None:
    drag = Effect(name="aerodynamic_drag", parameters={"c": 0.1})
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    assert motion_deceleration(3.0, 0.0, 0.0, motion([drag, drag])) == pytest.approx(0.2 * 9.0)
    with pytest.raises(ParameterError, match="at most once"):
        motion([lag, lag])
    assert motion([Effect(name="wheel_lockup", parameters={"mu": 0.7})], 0.5).friction == 0.5


TABLES = {
    "grass": SurfaceBraking(),
    "ice": SurfaceBraking(class_id=7),
    "mud": SurfaceBraking(),
    "grass, weaker": SurfaceBraking(class_id=100, state_of="grass"),
    "weaker": SurfaceBraking(class_id=101, state_of=""),
}


@pytest.mark.parametrize(
    ("name", "surface"),
    [
        ("", ""),
        ("#0", ""),
        ("mud", "mud"),
        ("#7", "ice"),
        ("#1", "grass"),
        ("#3", "mud"),
        # A table that has a number is not meant by its place in the file.
        ("#2", None),
        ("#6", None),
        ("gravel", None),
        ("#", None),
        ("#-1", None),
        ("# 1", None),
    ],
)
def test_class_name_is_that_of_one_surface_or_unknown(name: str, surface: str | None) -> None:
    assert resolve_class(TABLES, name) == surface


def test_class_number_zero_is_the_base_unless_a_surface_has_it() -> None:
    tables = {**TABLES, "sand": SurfaceBraking(class_id=0)}
    assert resolve_class(tables, "#0") == "sand"
    assert resolve_class(tables, "") == ""


def test_candidates_are_the_states_of_a_known_surface_and_all_of_an_unknown_one() -> None:
    assert candidate_surfaces(TABLES, "grass") == ("grass", "grass, weaker")
    assert candidate_surfaces(TABLES, "#0") == ("", "weaker")
    assert candidate_surfaces(TABLES, "#7") == ("ice",)
    assert candidate_surfaces(TABLES, "gravel") == ("", *TABLES)


def test_number_names_call_zero_the_base() -> None:
    assert number_names(0) == ("",)
    assert number_names(3) == ("", "#1", "#2", "#3")


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


def test_same_objects_and_equal_numbers_have_one_result() -> None:
    calls: list[float] = []
    recent: Recent[int] = Recent()
    ground, duplicate = np.zeros(3), np.zeros(3)

    def length() -> int:
        calls.append(1.0)
        return len(calls)

    assert recent.get(length, ground, 0.1 + 0.2) == 1
    assert recent.get(length, ground, 0.1 + 0.2) == 1
    assert recent.get(length, duplicate, 0.1 + 0.2) == 2
    assert recent.get(length, ground, 0.4) == 3


def test_only_the_last_few_are_cached() -> None:
    recent: Recent[int] = Recent(2)
    arguments = [object() for _ in range(3)]
    for n, argument in enumerate(arguments):
        assert recent.get(lambda n=n: n, argument) == n  # type: ignore[misc]
    assert recent.get(lambda: 10, arguments[2]) == 2
    assert recent.get(lambda: 10, arguments[0]) == 10
