"""Labels of limiting bounds, and the ranking of plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.labels import labels
from slopewise.planner.pipeline.ranking import rank, ranking_cost, travel_cost
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import plane, straight
from tests.world.vehicles import model_of, tables_with


@pytest.mark.parametrize(
    ("speed_sq", "accel", "smoothed", "expected"),
    [
        (4.0, 0.0, True, Limiting.LATERAL),  # at the bound
        (1.0, 1.0, True, Limiting.ACCEL),
        (1.0, -1.5, True, Limiting.DECEL),
        (1.0, 0.3, True, Limiting.JERK),
        (1.0, 0.3, False, Limiting.ACCEL),
        (1.0, -0.3, True, Limiting.JERK),
    ],
)
def test_each_label(speed_sq: float, accel: float, smoothed: bool, expected: Limiting) -> None:
    names = labels(
        np.full(3, speed_sq),
        np.full(3, accel),
        np.full(3, 4.0),
        np.full(3, int(Limiting.LATERAL)),
        np.full(2, 1.0),
        np.full(2, 1.5),
        1.0,
        smoothed,
    )
    assert set(names) == {int(expected)}


PATHS = [straight(11.9, name="short"), straight(12.0, name="wide")]
"""The longer one has stations a little farther apart, so more is left behind its last stop."""

DEAR = PlannerSettings(margin_weight=100.0)


def two(settings: PlannerSettings) -> list[SpeedPlan]:
    return CandidatePlanner(model_of(tables_with()), settings).plan(plane(), PATHS)


def test_cost_is_time_plus_missed_distance_less_margin() -> None:
    plan, _ = two(PlannerSettings())
    settings = PlannerSettings(horizon_penalty=3.0, margin_weight=0.7, margin_enough=100.0)
    missed = plan.station[-1] - plan.progress
    cost = plan.travel_time + 3.0 * missed
    assert travel_cost(plan, settings) == pytest.approx(cost)
    assert ranking_cost(plan, settings) == pytest.approx(cost - 0.7 * plan.least_margin)
    enough = replace(settings, margin_enough=0.1)
    assert ranking_cost(plan, enough) == pytest.approx(cost - 0.07)
    assert ranking_cost(plan, PlannerSettings()) == travel_cost(plan, PlannerSettings())


@pytest.mark.parametrize(
    ("settings", "best"), [(PlannerSettings(), "short"), (DEAR, "wide")], ids=["time", "margin"]
)
def test_plan_and_horizon_choose_by_the_same_weights(settings: PlannerSettings, best: str) -> None:
    plans = two(settings)
    assert plans[1].least_margin > plans[0].least_margin
    assert rank(plans, settings)[0].candidate == best
    horizon = Horizon(model_of(tables_with()), HorizonSettings(budget=60.0), settings)
    answer = horizon.step(PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0), PATHS, plane())
    assert answer.chosen is not None
    assert answer.chosen.candidate == best
