"""Trained range: grades between stations, hulls of speeds, and the force that stops count on."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.effects.registry import NO_MOTION
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.surfaces import (
    FASTEST,
    M_M,
    STEEPEST_DOWN,
    STEEPEST_UP,
    UP_M_M,
    SurfaceCache,
    hull_lines,
    lines,
    surface_table,
)
from slopewise.planner.limiting import Limiting
from slopewise.planner.settings import PlannerSettings
from tests.models.driven_hull import highest_speed
from tests.world.ground import ground_map, iced, straight
from tests.world.plans import assert_sound, labels, plan_one, violations
from tests.world.stages import braking_ground_of
from tests.world.vehicles import BASE, SMALL, model_of, tables_with

slopes = st.floats(-0.5, 0.5)


def forces_on(
    grade: np.ndarray, cache: SurfaceCache, margin: float, bits: np.ndarray
) -> np.ndarray:
    """Rows of the force along candidates, whose surfaces (M,) are the same at all stations."""
    n, m = grade.shape
    profile: Any = SimpleNamespace(
        count=np.full(m, n),
        grade=grade,
        sin_grade=np.sin(grade),
        sin_roll=np.zeros((n, m)),
        known=np.ones((n, m), np.bool_),
        surfaces=np.ascontiguousarray(np.broadcast_to(bits, (n, m)).astype(np.int64)),
    )
    return core.braking_forces(profile, cache, margin, None, None, None)[0]


def surfaces_of(table: np.ndarray, hull: np.ndarray | None) -> SurfaceCache:
    """Surfaces, and for each a class of the map."""
    bits = 1 << np.arange(len(table))
    return SurfaceCache(table, bits, None, hull, NO_MOTION, False, True)


def extrapolates(grade: np.ndarray, down: float, up: float) -> np.ndarray:
    """Stations (N,) that leave the trained grades, where alone the slopes of both bounds differ."""
    table, _ = surface_table(BASE, ("",), None)
    table[0, [M_M, UP_M_M, STEEPEST_DOWN, STEEPEST_UP]] = 0.0, 0.0, down, up
    rows = forces_on(grade[:, None], surfaces_of(table, None), 1.0, np.ones(1))
    differ: np.ndarray = rows[0, :, 0] != rows[2, :, 0]
    return differ


@given(st.floats(0.05, 5.95), slopes, slopes, st.floats(-0.3, 0.3))
def test_one_kink_is_found_wherever_it_is(
    kink: float, before: float, after: float, at: float
) -> None:
    stations = np.arange(8.0)

    def grade(s: np.ndarray) -> np.ndarray:
        return at + np.where(s < kink, before * (s - kink), after * (s - kink))

    steps = grade(stations)
    for k in range(1, 7):
        near = steps[k - 1 : k + 2]
        assert extrapolates(steps, near.min() + 1e-9, 1.0)[k]
        assert extrapolates(steps, -1.0, near.max() - 1e-9)[k]
        between = grade(np.linspace(k - 1, k + 1, 2001))
        shown = 2e-3 * abs(after - before) + 1e-9
        if 2 <= k <= 5 or not (k - 1 < kink < k + 1):
            assert extrapolates(steps, between.min() + shown, 1.0)[k]
            assert extrapolates(steps, -1.0, between.max() - shown)[k]
    one_more = abs(before) + abs(after) + 1e-9
    assert not extrapolates(steps, steps.min() - one_more, steps.max() + one_more).any()


HULL: Matrix = ((-0.26, 1.5), (-0.1, 3.0), (0.1, 4.0), (0.26, 3.5))


def with_hull(hull: Matrix | None, **further: object) -> Braking:
    return dataclasses.replace(BASE.braking, speed_by_grade=hull, **further)  # type: ignore[arg-type]


def test_the_lowest_of_the_lines_is_the_speed_between_the_corners() -> None:
    grade = np.linspace(-0.26, 0.26, 101)
    intercept, slope = lines(HULL).T
    lowest = np.min(intercept + slope * grade[:, None], axis=1)
    np.testing.assert_allclose(lowest, highest_speed(HULL, grade), atol=1e-12)


@pytest.mark.parametrize(
    ("hull", "message"),
    [
        (((0.0, 1.0),), "2 … 24 pairs"),
        (((0.0, 1.0, 2.0), (0.1, 1.0, 2.0)), "pairs of grade and speed"),
        (((0.0, 1.0), (0.0, 2.0)), "grades that increase"),
        (((0.0, np.nan), (0.1, 2.0)), "finite grades"),
        (((0.0, -1.0), (0.1, 2.0)), "speeds >= 0"),
        (((-0.1, 3.0), (0.0, 1.0), (0.1, 3.0)), "concave over the grade"),
    ],
)
def test_what_is_no_hull_is_refused(hull: Matrix, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        with_hull(hull)
    assert caught.value.field == "speed_by_grade"


SPEED_BY_GRADE = ((-0.26, 1.0), (-0.1, 3.0), (0.0, 4.0), (0.26, 3.0))


def around(grade: np.ndarray) -> list[np.ndarray]:
    return [np.vstack((grade[:1], grade[:-1])), grade, np.vstack((grade[1:], grade[-1:]))]


def test_each_station_counts_with_its_neighbours() -> None:
    grade = np.random.default_rng(0).uniform(-0.26, 0.26, (40, 70))
    model = model_of(tables_with(braking={"speed_by_grade": SPEED_BY_GRADE}))
    hull = hull_lines(1, model)
    assert hull is not None
    table, _ = surface_table(model, ("",), None)
    table[:, FASTEST] = 3.2
    fastest = forces_on(grade, surfaces_of(table, hull), -1.0, np.ones(70))[7]
    expected = np.minimum(
        3.2, np.min([highest_speed(SPEED_BY_GRADE, g) for g in around(grade)], axis=0)
    )
    np.testing.assert_allclose(fastest, expected, atol=1e-12)


def test_of_several_surfaces_the_slowest_counts() -> None:
    level = ((-0.26, 2.0), (0.26, 2.0))
    tables = {"ice": {"b_b": 0.2, "speed_by_grade": level}, "mud": {"speed_range": [0.5, 3.0]}}
    model = model_of(tables_with(braking={"speed_by_grade": SPEED_BY_GRADE, "terrain": tables}))
    hull = hull_lines(4, model)  # one more for ground never braked on
    assert hull is not None
    grade = np.random.default_rng(1).uniform(-0.26, 0.26, (30, 15))
    bits = np.arange(1, 16)
    table = np.tile(surface_table(model, ("",), None)[0][:1], (4, 1))
    table[:, FASTEST] = 4.0
    fastest = forces_on(grade, surfaces_of(table, hull), -1.0, bits)[7]
    base = np.min([highest_speed(SPEED_BY_GRADE, g) for g in around(grade)], axis=0)
    ice = np.full(grade.shape, 2.0)
    expected = np.full(grade.shape, 4.0)
    for bit, speed in ((0, base), (1, ice), (3, np.minimum(base, ice))):
        expected = np.where((bits >> bit) & 1, np.minimum(expected, speed), expected)
    np.testing.assert_allclose(fastest, expected, atol=1e-12)


@pytest.mark.parametrize("changes", [{}, {"speed_by_grade": SPEED_BY_GRADE, "extrapolate": True}])
def test_without_a_hull_or_with_leave_to_extrapolate_nothing_is_held(changes: dict) -> None:
    assert hull_lines(1, model_of(tables_with(braking=changes))) is None


def test_plans_stay_below_it_and_name_it() -> None:
    hill = ground_map(lambda x, y: 0.8 * np.sin(x / 4.0) + 0.0 * y)
    tables = tables_with(braking={"speed_by_grade": SPEED_BY_GRADE}, limits={"accel": 2.0})
    held = plan_one(tables, hill, straight(30.0))
    free = plan_one(tables_with(limits={"accel": 2.0}), hill, straight(30.0))
    speed, grade, unlimited = held.speed, held.grade, free.speed
    assert np.all(speed <= highest_speed(SPEED_BY_GRADE, grade) + 1e-9)
    assert np.any(unlimited > highest_speed(SPEED_BY_GRADE, grade) + 0.1)
    assert np.all(speed <= unlimited + 1e-6)
    assert Limiting.MODEL_VALIDITY.name.lower() in labels(held)
    assert_sound(held, tables, hill)


_TABLES = ("vehicle", "terrain", "limits")


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
