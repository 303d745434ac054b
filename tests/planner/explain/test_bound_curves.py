"""Every bound by itself: together they are the bound of the plan."""

from __future__ import annotations

import numpy as np
import pytest

from planner.explain.bound_curves import bound_curves
from planner.limiting import Limiting
from planner.path import CandidatePath
from tests.planner.scenes import (
    ATV,
    Tables,
    arc,
    ground_map,
    model_of,
    plan_one,
    plane,
    straight,
    tables_with,
)


@pytest.mark.parametrize("path", [straight(30.0), arc(20.0, 0.15)], ids=["straight", "arc"])
def test_the_lowest_curve_is_the_bound_of_the_plan(path: CandidatePath) -> None:
    ground = ground_map(lambda x, y: 0.5 * np.sin(x / 4.0) + 0.2 * np.cos(y / 3.0))
    plan = plan_one(ATV, ground, path)
    curves = bound_curves(ground, plan, model_of(ATV))
    lowest = np.min(list(curves.values()), axis=0)
    inside = plan.station < plan.clear_distance - 1.0
    # A plan's bound is lowered a little so that it holds between stations as well.
    assert np.all(plan.speed_bound[inside] <= lowest[inside] + 1e-9)
    assert np.all(plan.speed_bound[inside] >= 0.97 * lowest[inside])


@pytest.mark.parametrize(
    ("bound", "tables", "path", "expected"),
    [
        (Limiting.SPEED_LIMIT, tables_with(limits={"speed": 2.0}), straight(20.0), 2.0),
        (Limiting.LATERAL, tables_with(limits={"lateral_accel": 0.5}), arc(12.0, 0.2), 1.581),
        (Limiting.WHEEL_SPEED, tables_with(vehicle={"max_wheel_speed": 1.5}), straight(20.0), 1.5),
        (Limiting.MODEL_VALIDITY, tables_with(braking={"speed_range": [1.0, 3.0]}),
         straight(20.0), 3.0),
        # P / (m g f_r)
        (Limiting.TRACTION, tables_with(vehicle={"max_drive_power": 1000.0}), straight(20.0),
         1000.0 / (500.0 * 9.80665 * 0.13)),
    ],
)  # fmt: skip
def test_each_curve_is_the_speed_of_its_bound(
    bound: Limiting, tables: Tables, path: CandidatePath, expected: float
) -> None:
    plan = plan_one(tables, plane(), path)
    curve = bound_curves(plane(), plan, model_of(tables))[bound]
    middle = len(curve) // 2
    assert curve[middle] == pytest.approx(expected, rel=0.01)


def test_the_stopping_path_is_open_far_from_the_end_and_closes_there() -> None:
    plan = plan_one(ATV, plane(), straight(30.0))
    curve = bound_curves(plane(), plan, model_of(ATV))[Limiting.STOPPING_PATH]
    assert np.isinf(curve[0])
    near = np.isfinite(curve)
    assert near.sum() > 5
    assert np.all(np.diff(curve[near]) <= 1e-9)
    assert curve[-1] == 0.0
