"""Trained range: grades between stations, and the hull of speeds by grade."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.planner.ground.grade_between import grade_between
from slopewise.planner.ground.hull_speed import hold_below, hull_lines, lines
from slopewise.planner.limiting import Limiting
from tests.models.driven_hull import highest_speed
from tests.world.ground import ground_map, straight
from tests.world.plans import assert_sound, labels, plan_one
from tests.world.vehicles import BASE, model_of, tables_with

slopes = st.floats(-0.5, 0.5)


@given(st.floats(0.05, 5.95), slopes, slopes, st.floats(-0.3, 0.3))
def test_one_kink_is_found_wherever_it_is(
    kink: float, before: float, after: float, at: float
) -> None:
    stations = np.arange(8.0)

    def grade(s: np.ndarray) -> np.ndarray:
        return at + np.where(s < kink, before * (s - kink), after * (s - kink))

    lowest, highest = grade_between(grade(stations)[:, None])
    for k in range(1, 7):
        around = grade(np.linspace(k - 1, k + 1, 2001))
        inner = 2 <= k <= 5 or not (k - 1 < kink < k + 1)
        if inner:
            assert lowest[k, 0] <= around.min() + 2e-3 * abs(after - before)
            assert highest[k, 0] >= around.max() - 2e-3 * abs(after - before)
        assert lowest[k, 0] <= min(grade(stations)[k - 1 : k + 2])
        assert highest[k, 0] >= max(grade(stations)[k - 1 : k + 2])


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
    fastest = np.full(grade.shape, 3.2)
    hold_below(fastest, grade, np.ones(grade.shape, np.int64), hull)
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
    grade = np.random.default_rng(1).uniform(-0.26, 0.26, (30, 20))
    bits = np.random.default_rng(2).integers(1, 16, grade.shape)
    fastest = np.full(grade.shape, 4.0)
    hold_below(fastest, grade, bits, hull)
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
