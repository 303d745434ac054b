"""Explanations: a scene for each bound and each measurement, and what cannot be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Effect, Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.explain.explain import Explanation, explain, stretches
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import Status
from slopewise.planner.settings import PlannerSettings
from tests.planner import generated
from tests.planner.scenes import arc, ground_map, model_of, plane, straight, tables_with

LEVEL = plane()
WIDE = plane(x=(-30.0, 30.0), y=(-30.0, 30.0))


def fine(height: Callable[[np.ndarray, np.ndarray], Any]) -> ElevationMap:
    """Cells finer than a wheel."""
    return ground_map(height, resolution=0.1)


def seconds(explanation: Explanation, bound: Limiting) -> float:
    return next(cost.seconds for cost in explanation.costs if cost.limiting is bound)


def bought(explanation: Explanation, name: str) -> float:
    return next(m.seconds for m in explanation.measurements if m.name == name)


def with_tables(**tables: dict[str, Any]) -> Model:
    out = tables_with()
    for table, values in tables.items():
        out[table] |= values
    return model_of(out)


def with_limits(**limits: float) -> Model:
    return with_tables(limits=limits)


# ------------------------------------------------------------------------------------ bounds

FAST = {"speed": 4.0, "accel": 4.0, "decel": 4.0, "jerk": 50.0, "lateral_accel": 20.0}


SCENES: dict[Limiting, tuple[Model, ElevationMap, Any, dict[str, Any]]] = {
    Limiting.SPEED_LIMIT: (with_limits(speed=1.5), LEVEL, straight(20.0), {}),
    Limiting.STOPPING_PATH: (with_limits(**FAST), LEVEL, straight(20.0), {"clear": 4.88}),
    Limiting.TIP_OVER: (
        with_tables(limits={"min_load": 0.6}, braking={"m_b": 0.05, "b_b": 0.35}),
        LEVEL,
        straight(20.0),
        {},
    ),
    Limiting.ROLLOVER: (
        with_tables(limits={**FAST, "min_load": 0.55}, vehicle={"track_width": 0.5}),
        WIDE,
        arc(20.0, 0.3),
        {},
    ),
    Limiting.LATERAL: (with_limits(lateral_accel=0.3), WIDE, arc(20.0, 0.2), {}),
    Limiting.WHEEL_SPEED: (
        with_tables(vehicle={"max_wheel_speed": 1.2}),
        LEVEL,
        straight(20.0),
        {},
    ),
    Limiting.TRACTION: (with_tables(vehicle={"max_drive_power": 800.0}), LEVEL, straight(20.0), {}),
    Limiting.ACCEL: (with_limits(accel=0.2), LEVEL, straight(20.0), {}),
    Limiting.DECEL: (with_limits(decel=0.3), LEVEL, straight(20.0), {}),
    Limiting.JERK: (with_limits(jerk=0.1), LEVEL, straight(20.0), {}),
    Limiting.UNKNOWN_TERRAIN: (
        with_limits(),
        plane(unknown=lambda x, y: x > 10.0),
        straight(20.0),
        {},
    ),
    Limiting.STEP: (with_limits(), fine(lambda x, y: 0.15 * (x > 10.0)), straight(20.0), {}),
    Limiting.CLEARANCE: (
        with_tables(vehicle={"front_overhang": 0.0}),
        fine(lambda x, y: 0.4 * (np.hypot(x - 10.0, y) < 0.2)),
        straight(20.0),
        {},
    ),
    Limiting.BODY: (
        with_tables(vehicle={"front_overhang": 0.6}),
        fine(lambda x, y: 0.4 * (np.hypot(x - 10.0, y) < 0.2)),
        straight(20.0),
        {},
    ),
    Limiting.ROUGHNESS: (
        with_limits(),
        fine(lambda x, y: 0.04 * np.sin(2.0 * np.pi * x / 1.5)),
        straight(20.0),
        {},
    ),
    Limiting.MODEL_VALIDITY: (
        with_tables(braking={"grade_range": [-0.05, 0.05]}),
        ground_map(lambda x, y: 0.1 * np.clip(x - 8.0, 0.0, None)),
        straight(20.0),
        {},
    ),
    Limiting.STEP: (with_limits(), fine(lambda x, y: 0.2 * (x > 10.0)), straight(20.0), {}),
    Limiting.CLEARANCE: (
        with_tables(vehicle={"front_overhang": 0.0}),
        fine(lambda x, y: 0.6 * np.exp(-((x - 10.0) ** 2 + y**2) / 0.02)),
        straight(20.0),
        {},
    ),
    Limiting.BODY: (
        with_tables(vehicle={"width": 1.8}),
        fine(lambda x, y: 1.5 * ((y > 0.8) & (x > 10.0))),
        straight(20.0),
        {},
    ),
    Limiting.ROUGHNESS: (
        with_limits(),
        fine(lambda x, y: 0.03 * np.sin(2.0 * np.pi * x / 1.1)),
        straight(20.0),
        {},
    ),
    Limiting.CREST: (
        with_tables(
            limits={**FAST, "speed": 6.0},
            braking={"speed_range": [1.0, 6.0]},
            vehicle={"max_drive_force": 9e3, "max_drive_power": 9e4, "max_wheel_speed": 20.0},
        ),
        ground_map(lambda x, y: -0.14 * np.abs(x - 14.0), resolution=0.5),
        straight(28.0),
        {},
    ),
    Limiting.FRICTION: (
        with_tables(limits={**FAST, "min_load": 0.02}, braking={"sliding_friction": 0.42}),
        WIDE,
        arc(20.0, 0.2),
        {},
    ),
    Limiting.HOLDING: (
        with_tables(braking={"b_b": 0.12, "b_m": 0.0}),
        ground_map(lambda x, y: 0.2 * np.clip(x - 8.0, 0.0, None)),
        straight(20.0),
        {},
    ),
}


@pytest.mark.parametrize("bound", Limiting)
def test_a_limiting_bound_has_the_highest_cost(bound: Limiting) -> None:
    model, ground, path, options = SCENES[bound]
    explanation = explain(model, ground, path, **options)
    # Brakes that stop immediately hold as well.
    foremost = explanation.costs[: {Limiting.HOLDING: 2, Limiting.CREST: 3}.get(bound, 1)]
    costs = [(c.limiting.label, c.seconds) for c in explanation.costs]
    assert bound in {cost.limiting for cost in foremost}, costs
    assert explanation.costs[0].seconds > 0.1
    plan = explanation.plan
    at_rest = int(np.searchsorted(plan.station, plan.progress))
    assert bound in {int(plan.limiting[at_rest]), *(s.limiting for s in explanation.stretches)}


@pytest.mark.parametrize(
    "bound",
    [
        b
        for b in Limiting
        if b
        not in (
            Limiting.ACCEL,
            Limiting.DECEL,
            Limiting.JERK,
            Limiting.SPEED_LIMIT,
            Limiting.STOPPING_PATH,
        )
    ],
)
def test_a_bound_that_does_not_bite_costs_nothing(bound: Limiting) -> None:
    """Level known ground, straight on, slowly: only comfort, speed limit and stop count."""
    explanation = explain(with_limits(speed=2.0), LEVEL, straight(20.0))
    assert seconds(explanation, bound) == 0.0


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


# ------------------------------------------------------------------------------ measurements

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


def test_old_parameters_and_uncertain_effects_are_braking_too() -> None:
    at_stake = {"clear": 5.0, "start_speed": 1.5}
    aged = Uncertainty(age=4 * 3600.0)
    old = explain(scattered(), LEVEL, straight(20.0), uncertainty=aged, **at_stake)
    assert bought(old, "braking") > 0.05
    effect = Effect(name="session_drift", parameters={"k": -1e-9}, covariance=((1e-11,),))
    drifting = replace(scattered(), effect=(effect,))
    explanation = explain(drifting, LEVEL, straight(20.0), uncertainty=UNCERTAIN, **at_stake)
    assert bought(explanation, "braking") > 0.05


def test_with_the_mean_alone_no_certainty_is_bought() -> None:
    model = scattered(force_std=0.04, dead_time_std=0.1)
    explanation = explain(model, LEVEL, straight(20.0), clear=5.88)
    for name in ("braking", "dead_time", "map_slopes"):
        assert bought(explanation, name) == 0.0


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
    steep = SCENES[Limiting.MODEL_VALIDITY]
    explanation = explain(steep[0], steep[1], steep[2])
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
    wide = explain(scattered(distance_offset=1.0), LEVEL, straight(20.0), clear=6.88)
    assert bought(wide, "stop_offset") > 1.0
    assert (
        bought(explain(scattered(distance_offset=0.0), LEVEL, straight(20.0)), "stop_offset") == 0
    )


# -------------------------------------------------------------------------------- properties


@settings(max_examples=12)
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


def test_what_is_explained_is_the_plan_of_the_planner() -> None:
    uncertainty = Uncertainty(slope_std=0.01)
    model = scattered(force_std=0.02)
    ground = ground_map(lambda x, y: 0.3 * np.sin(x / 4.0))
    options: dict[str, Any] = {"start_speed": 1.0, "clear": 15.0}
    (plan,) = CandidatePlanner(model, uncertainty=uncertainty).plan(
        ground, [arc(20.0, 0.05)], **options
    )
    explanation = explain(model, ground, arc(20.0, 0.05), uncertainty=uncertainty, **options)
    np.testing.assert_allclose(explanation.plan.speed, plan.speed, atol=1e-9)
    assert explanation.plan.status is plan.status


def test_a_plan_at_rest_names_the_blocking_bounds() -> None:
    hidden = plane(unknown=lambda x, y: x > 0.3)
    explanation = explain(with_limits(), hidden, straight(20.0))
    assert explanation.plan.status is Status.BLOCKED
    assert stretches(explanation.plan) == ()
    assert explanation.costs[0].limiting is Limiting.UNKNOWN_TERRAIN
    assert explanation.costs[0].reach > 15.0
