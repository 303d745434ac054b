"""The force that stops count on: mixed trained speeds, and dips between stations."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import ground_map, iced, straight
from tests.world.plans import plan_one, violations
from tests.world.stages import braking_ground_of
from tests.world.vehicles import SMALL, model_of, tables_with

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
