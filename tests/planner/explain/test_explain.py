"""Costs of each bound, and each bound as a curve."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.parameters import Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.explain.bound_curves import bound_curves
from slopewise.planner.explain.explain import Explanation, explain
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.settings import PlannerSettings
from tests.world import generated
from tests.world.bound_scenes import SCENES
from tests.world.ground import Height, arc, ground_map, plane, straight
from tests.world.plans import plan_one
from tests.world.vehicles import ATV, Tables, model_of, tables_with

LEVEL = plane()
OF_BOUND = {scene.label: scene for scene in reversed(SCENES.values())}
"""The first scene of each bound."""


def seconds(explanation: Explanation, bound: Limiting) -> float:
    return next(cost.seconds for cost in explanation.costs if cost.limiting is bound)


def bought(explanation: Explanation, name: str) -> float:
    return next(m.seconds for m in explanation.measurements if m.name == name)


def with_tables(**tables: dict[str, Any]) -> Model:
    return model_of(tables_with(**tables))


def with_limits(**limits: float) -> Model:
    return with_tables(limits=limits)


FAST = {"speed": 4.0, "accel": 4.0, "decel": 4.0, "jerk": 50.0, "lateral_accel": 20.0}


COMFORT = {"accel", "decel", "jerk", "speed_limit", "stopping_path"}


@pytest.mark.parametrize("bound", Limiting)
def test_a_limiting_bound_has_the_highest_cost(bound: Limiting) -> None:
    scene = OF_BOUND[bound.label]
    explanation = explain(model_of(scene.tables), scene.ground, scene.path)
    # Brakes that stop immediately hold as well; a stop before unknown ground is due to that.
    close = {Limiting.HOLDING: 2, Limiting.CREST: 3, Limiting.STOPPING_PATH: 3}
    foremost = explanation.costs[: close.get(bound, 1)]
    costs = [(c.limiting.label, c.seconds) for c in explanation.costs]
    assert bound in {cost.limiting for cost in foremost}, costs
    assert explanation.costs[0].seconds > 0.1
    plan = explanation.plan
    at_rest = int(np.searchsorted(plan.station, plan.progress))
    assert bound in {int(plan.limiting[at_rest]), *(s.limiting for s in explanation.stretches)}


def test_a_bound_that_does_not_bite_costs_nothing() -> None:
    """Level known ground, straight on, slowly: only comfort, speed limit and stop count."""
    explanation = explain(with_limits(speed=2.0), LEVEL, straight(20.0))
    for bound in Limiting:
        assert bound.label in COMFORT or seconds(explanation, bound) == 0.0, bound


def test_the_cost_of_a_speed_limit_is_its_closed_form() -> None:
    """30 m at 2 m/s instead of 4 m/s, 1 m/s² up and 1.5 m/s² down, ends 0.2 m short."""
    model, settings = with_limits(speed=2.0, jerk=1e3), PlannerSettings(smooth=False)
    explanation = explain(model, LEVEL, straight(30.0), settings=settings)
    way = explanation.plan.progress

    def time(top: float) -> float:
        ramps = 0.5 * top**2 * (1.0 + 1.0 / 1.5)
        return top * (1.0 + 1.0 / 1.5) + (way - ramps) / top

    assert seconds(explanation, Limiting.SPEED_LIMIT) == pytest.approx(
        time(2.0) - time(4.0), abs=0.05
    )


def test_the_cost_of_unknown_ground_is_the_charge_for_what_is_not_reached() -> None:
    model, ground = with_limits(), plane(unknown=lambda x, y: x > 10.0)
    explanation = explain(model, ground, straight(20.0))
    cost = explanation.costs[0]
    free = explain(model, LEVEL, straight(20.0)).plan
    assert cost.limiting is Limiting.UNKNOWN_TERRAIN
    assert cost.reach == pytest.approx(free.progress - explanation.plan.progress)
    assert cost.seconds == pytest.approx(
        2.0 * cost.reach - (free.travel_time - explanation.plan.travel_time), abs=1e-6
    )
    higher = explain(model, ground, straight(20.0), settings=PlannerSettings(horizon_penalty=4.0))
    assert higher.costs[0].seconds == pytest.approx(cost.seconds + 2.0 * cost.reach, abs=1e-6)


UNCERTAIN = Uncertainty(slope_std=0.0)


def scattered(**braking: Any) -> Model:
    return with_tables(limits=FAST, braking=braking)


def test_what_is_uncertain_buys_time_when_it_is_known() -> None:
    at_stake = {"clear": 5.0, "start_speed": 1.5, "uncertainty": UNCERTAIN}
    forces = explain(scattered(force_std=0.04), LEVEL, straight(20.0), **at_stake)
    assert bought(forces, "braking") > 0.05
    assert bought(forces, "dead_time") == bought(forces, "map_slopes") == 0.0
    times = explain(scattered(dead_time_std=0.1), LEVEL, straight(20.0), **at_stake)
    assert bought(times, "dead_time") > 0.05
    assert bought(times, "braking") == 0.0
    at_stake["uncertainty"] = Uncertainty(slope_std=0.03)
    slopes = explain(scattered(), LEVEL, straight(20.0), **at_stake)
    assert bought(slopes, "map_slopes") > 0.05
    assert bought(slopes, "braking") == bought(slopes, "dead_time") == 0.0


def test_a_clear_path_and_known_ground_lead_farther() -> None:
    explanation = explain(with_limits(), LEVEL, straight(20.0), clear=8.88)
    first = explanation.measurements[0]
    assert first.name == "clear_distance"
    assert first.reach == pytest.approx(12.0, abs=0.3)
    assert f"{first.reach:.1f} m farther" in first.sentence
    hidden = plane(unknown=lambda x, y: x > 10.0)
    assert explain(with_limits(), hidden, straight(20.0)).measurements[0].name == "map_coverage"


def test_trained_ranges_are_distinguished() -> None:
    slow = explain(with_tables(braking={"speed_range": [0.5, 1.0]}), LEVEL, straight(20.0))
    assert slow.measurements[0].name == "speed_range"
    assert bought(slow, "grade_range") == 0.0
    steep = OF_BOUND["model_validity"]
    explanation = explain(model_of(steep.tables), steep.ground, steep.path)
    assert explanation.measurements[0].name == "grade_range"
    assert bought(explanation, "speed_range") == 0.0


def test_a_measured_stop_on_unknown_ground_has_a_benefit() -> None:
    ground = ground_map(
        lambda x, y: 0.0, classes=lambda x, y: (x > 3.0).astype(int), class_names=("", "moss")
    )
    model = with_limits(**FAST)
    icy = replace(model.braking, terrain={"ice": SurfaceBraking(b_b=0.2)})
    model = replace(model, braking=icy)
    at_stake = {"clear": 10.0, "uncertainty": UNCERTAIN}
    assert explain(model, ground, straight(20.0), **at_stake).measurements[0].name in (
        "surface",
        "clear_distance",
    )
    assert bought(explain(model, ground, straight(20.0), **at_stake), "surface") > 0.2
    assert bought(explain(model, LEVEL, straight(20.0), **at_stake), "surface") == 0.0


def test_the_safety_offset_has_its_price() -> None:
    wide, none = (
        explain(scattered(distance_offset=offset), LEVEL, straight(20.0), clear=6.88)
        for offset in (1.0, 0.0)
    )
    assert bought(wide, "stop_offset") > 1.0
    assert bought(none, "stop_offset") == 0.0


@settings(max_examples=8)
@given(generated.scenes())
def test_nothing_is_ever_lost(scene: generated.Scene) -> None:
    """Costs and measurements are never negative; stretches cover the drive without a gap."""
    model = model_of(scene.tables)
    explanation = explain(
        model,
        scene.ground,
        scene.path,
        settings=scene.settings,
        uncertainty=Uncertainty(slope_std=0.005),
        **scene.options,
    )
    assert all(c.seconds >= 0.0 and c.reach >= 0.0 for c in explanation.costs)
    assert all(m.seconds >= 0.0 and m.reach >= 0.0 for m in explanation.measurements)
    assert [c.seconds for c in explanation.costs] == sorted(c.seconds for c in explanation.costs)[
        ::-1
    ]
    assert {c.limiting for c in explanation.costs} == set(Limiting)
    parts = explanation.stretches
    assert all(a.end == b.begin and a.limiting != b.limiting for a, b in pairwise(parts))
    if parts:
        assert parts[0].begin == 0.0
        assert parts[-1].end == explanation.plan.progress
        assert sum(p.seconds for p in parts) == pytest.approx(explanation.plan.travel_time)
    else:
        assert explanation.plan.progress == 0.0


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


SWIFT = {"limits": {"speed": 6.0, "vertical_accel": 50.0}, "braking": {"speed_range": [1.0, 6.0]}}
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
        (Limiting.CREST, bump(0.4, 1.6), 0.2, straight(30.0), SWIFT),
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
    spacing = PlannerSettings().spacing_on(resolution, model.vehicle)
    bounds = time_optimal_batch(ground, batch([path], spacing), model).bounds
    held = bounds.limiting[:, 0] == int(bound)
    assert held.sum() >= 3
    curve = bound_curves(ground, plan_one(tables, ground, path), model)[bound]
    speed = np.sqrt(bounds.speed_sq_max[held, 0])
    assert speed.min() == pytest.approx(curve[held].min(), rel=0.01)
    # Next to a lower station the planner lowers a bound so that v² in between stays below it.
    assert np.all(speed <= 1.001 * curve[held])
