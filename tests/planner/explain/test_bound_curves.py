"""Every bound individually: together they are the bound of the plan."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.explain.bound_curves import bound_curves
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import Height, arc, ground_map, plane, straight
from tests.world.plans import plan_one
from tests.world.vehicles import ATV, Tables, model_of, tables_with


def test_the_lowest_curve_is_the_bound_of_the_plan() -> None:
    ground = ground_map(lambda x, y: 0.5 * np.sin(x / 4.0) + 0.2 * np.cos(y / 3.0))
    plan = plan_one(ATV, ground, arc(20.0, 0.15))
    curves = bound_curves(ground, plan, model_of(ATV))
    lowest = np.min(list(curves.values()), axis=0)
    inside = plan.station < plan.clear_distance - 1.0
    # A plan's bound is lowered a little so that it holds between stations as well.
    assert np.all(plan.speed_bound[inside] <= lowest[inside] + 1e-9)
    assert np.all(plan.speed_bound[inside] >= 0.97 * lowest[inside])


@pytest.mark.parametrize(
    ("bound", "changes", "path", "expected"),
    [
        (Limiting.SPEED_LIMIT, {"limits": {"speed": 2.0}}, straight(20.0), 2.0),
        (Limiting.LATERAL, {"limits": {"lateral_accel": 0.5}}, arc(12.0, 0.2), 1.581),
        (Limiting.WHEEL_SPEED, {"vehicle": {"max_wheel_speed": 1.5}}, straight(20.0), 1.5),
        (Limiting.MODEL_VALIDITY, {"braking": {"speed_range": [1.0, 3.0]}}, straight(20.0), 3.0),
        # P / (m g f_r)
        (Limiting.TRACTION, {"vehicle": {"max_drive_power": 1000.0}}, straight(20.0), 1.5687),
    ],
)
def test_each_curve_is_the_speed_of_its_bound(
    bound: Limiting, changes: Tables, path: CandidatePath, expected: float
) -> None:
    tables = tables_with(**changes)
    curve = bound_curves(plane(), plan_one(tables, plane(), path), model_of(tables))[bound]
    assert curve[len(curve) // 2] == pytest.approx(expected, rel=0.01)


def test_the_stopping_path_is_open_far_from_the_end_and_closes_there() -> None:
    plan = plan_one(ATV, plane(), straight(30.0))
    curve = bound_curves(plane(), plan, model_of(ATV))[Limiting.STOPPING_PATH]
    assert np.isinf(curve[0])
    near = np.isfinite(curve)
    assert near.sum() > 5
    assert np.all(np.diff(curve[near]) <= 1e-9)
    assert curve[-1] == 0.0


FAST = {"limits": {"speed": 6.0, "vertical_accel": 50.0}, "braking": {"speed_range": [1.0, 6.0]}}
SLIPPERY = {
    "vehicle": {"max_drive_power": 20000.0},
    "limits": {"lateral_accel": 8.0, "accel": 2.0},
    "braking": {"sliding_friction": 0.35, "b_b": 0.2},
}


def bump(height: float, width: float) -> Height:
    return lambda x, y: height * np.exp(-(((x - 15.0) / width) ** 2))


@pytest.mark.parametrize(
    ("bound", "height", "resolution", "path", "changes"),
    [
        (Limiting.CREST, bump(0.4, 1.6), 0.2, straight(30.0), FAST),
        (Limiting.FRICTION, lambda x, y: 0.0 * x, 0.2, arc(6.0, 0.3), SLIPPERY),
        (Limiting.ROUGHNESS, lambda x, y: 0.03 * np.sin(np.pi * x), 0.2, straight(20.0), {}),
    ],
    ids=["crest", "friction", "washboard"],
)
def test_what_the_ground_allows_is_a_curve_of_its_own(
    bound: Limiting, height: Height, resolution: float, path: CandidatePath, changes: Tables
) -> None:
    ground, tables = ground_map(height, resolution=resolution), tables_with(**changes)
    model = model_of(tables)
    bounds = time_optimal_batch(
        ground, batch([path], PlannerSettings().spacing_on(resolution)), model
    ).bounds
    held = bounds.limiting[:, 0] == int(bound)
    assert held.sum() >= 3
    curve = bound_curves(ground, plan_one(tables, ground, path), model)[bound]
    speed = np.sqrt(bounds.speed_sq_max[held, 0])
    assert speed.min() == pytest.approx(curve[held].min(), rel=0.01)
    # Next to a lower station the planner lowers a bound so that v² in between stays below it.
    assert np.all(speed <= 1.001 * curve[held])
