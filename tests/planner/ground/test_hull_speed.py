"""No plan is faster on a grade than what was driven there; without a hull nothing changes."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.planner.ground.hull_speed import hold_below, hull_lines
from slopewise.planner.limiting import Limiting
from tests.models.driven_hull import highest_speed
from tests.planner.scenes import (
    assert_sound,
    ground_map,
    labels,
    model_of,
    plan_one,
    straight,
    tables_with,
)

HULL = ((-0.26, 1.0), (-0.1, 3.0), (0.0, 4.0), (0.26, 3.0))


def around(grade: np.ndarray) -> list[np.ndarray]:
    return [np.vstack((grade[:1], grade[:-1])), grade, np.vstack((grade[1:], grade[-1:]))]


def test_each_station_counts_with_its_neighbours() -> None:
    grade = np.random.default_rng(0).uniform(-0.26, 0.26, (40, 70))
    model = model_of(tables_with(braking={"speed_by_grade": HULL}))
    hull = hull_lines(1, model)
    assert hull is not None
    fastest = np.full(grade.shape, 3.2)
    hold_below(fastest, grade, np.ones(grade.shape, np.int64), hull)
    expected = np.minimum(3.2, np.min([highest_speed(HULL, g) for g in around(grade)], axis=0))
    np.testing.assert_allclose(fastest, expected, atol=1e-12)


def test_of_several_surfaces_the_slowest_counts() -> None:
    other = ((-0.26, 2.0), (0.26, 2.0))
    tables = {"ice": {"b_b": 0.2, "speed_by_grade": other}, "mud": {"speed_range": [0.5, 3.0]}}
    model = model_of(tables_with(braking={"speed_by_grade": HULL, "terrain": tables}))
    hull = hull_lines(4, model)  # one more for ground never braked on
    assert hull is not None
    grade = np.random.default_rng(1).uniform(-0.26, 0.26, (30, 20))
    bits = np.random.default_rng(2).integers(1, 16, grade.shape)
    fastest = np.full(grade.shape, 4.0)
    hold_below(fastest, grade, bits, hull)
    base = np.min([highest_speed(HULL, g) for g in around(grade)], axis=0)
    ice = np.full(grade.shape, 2.0)
    expected = np.full(grade.shape, 4.0)
    for bit, speed in ((0, base), (1, ice), (3, np.minimum(base, ice))):
        expected = np.where((bits >> bit) & 1, np.minimum(expected, speed), expected)
    np.testing.assert_allclose(fastest, expected, atol=1e-12)


@pytest.mark.parametrize("changes", [{}, {"speed_by_grade": HULL, "extrapolate": True}])
def test_without_a_hull_or_with_leave_to_extrapolate_nothing_is_held(changes: dict) -> None:
    assert hull_lines(1, model_of(tables_with(braking=changes))) is None


def test_plans_stay_below_it_and_say_why() -> None:
    hill = ground_map(lambda x, y: 0.8 * np.sin(x / 4.0) + 0.0 * y)
    tables = tables_with(braking={"speed_by_grade": HULL}, limits={"accel": 2.0})
    held = plan_one(tables, hill, straight(30.0))
    free = plan_one(tables_with(limits={"accel": 2.0}), hill, straight(30.0))
    speed, grade, unlimited = held.speed, held.grade, free.speed
    assert np.all(speed <= highest_speed(HULL, grade) + 1e-9)
    assert np.any(unlimited > highest_speed(HULL, grade) + 0.1)
    assert np.all(speed <= unlimited + 1e-6)
    assert Limiting.MODEL_VALIDITY.name.lower() in labels(held)
    assert_sound(held, tables, hill)
