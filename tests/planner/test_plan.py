"""Columns of plans, settings of the planner, and certainty of the ground.

Every bound has a scene in which it bites, and one with one thing changed in which it must not.

Both plans have to pass the checker, and the one that is limited is slower or ends earlier.
"""

from __future__ import annotations

import dataclasses
import importlib
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on
from slopewise.planner.compiled_core import core
from slopewise.planner.explain.relaxed import without
from slopewise.planner.explain.what_if import Assumptions
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.horizon import HorizonSettings
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world import generated
from tests.world.bound_scenes import SCENES
from tests.world.generated import between
from tests.world.ground import ground_map, plane, straight
from tests.world.plans import assert_sound, at, labels, plan_one
from tests.world.vehicles import ATV, model_of, tables_with


@given(
    speed_sq=st.lists(st.floats(0.01, 25.0), min_size=3, max_size=30).map(np.array),
    ds=st.floats(0.05, 2.0),
)
def test_motion_is_that_of_constant_acceleration_on_each_segment(
    speed_sq: np.ndarray, ds: float
) -> None:
    station = ds * np.arange(len(speed_sq))
    accel, time = core.motion(station, speed_sq)
    v, dt = np.sqrt(speed_sq), np.diff(time)
    np.testing.assert_allclose(v[:-1] + accel[:-1] * dt, v[1:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        v[:-1] * dt + 0.5 * accel[:-1] * dt**2, np.full(len(dt), ds), rtol=1e-7
    )
    assert accel[-1] == 0.0
    assert time[0] == 0.0


@pytest.fixture
def plan() -> SpeedPlan:
    return plan_one(ATV, plane(unknown=lambda x, y: x > 12.0), straight(20.0))


def test_columns_are_those_of_a_plan_file_and_more(plan: SpeedPlan) -> None:
    columns = plan.columns()
    assert {len(values) for values in columns.values()} == {len(plan.station)}
    # In the order in which files have them.
    assert ",".join(columns).startswith(
        "candidate,station,x,y,z,grade,roll,curvature,speed,accel,time,speed_bound,limiting,"
        "stop_distance,clear_distance,rear_load,status,reason"
    )
    assert set(columns["status"]) == {"blocked"}
    assert set(columns["limiting"]) <= {name.name.lower() for name in Limiting}


def test_a_plan_that_does_not_move_or_cannot_be_is_not_admissible(plan: SpeedPlan) -> None:
    still = dataclasses.replace(plan, speed=np.zeros_like(plan.speed))
    assert still.progress == 0.0
    assert not still.admissible
    assert not dataclasses.replace(plan, status=Status.INFEASIBLE).admissible
    assert dataclasses.replace(plan, status=Status.DEGRADED).admissible


@pytest.mark.parametrize(
    ("settings", "values", "field"),
    [
        (PlannerSettings, {"spacing": 0.0}, "spacing"),
        (PlannerSettings, {"spacing": np.nan}, "spacing"),
        (PlannerSettings, {"horizon_penalty": -1.0}, "horizon_penalty"),
        (PlannerSettings, {"solver": "simplex"}, "solver"),
        (HorizonSettings, {"smoothed": 0}, "smoothed"),
        (HorizonSettings, {"budget": 0.0}, "budget"),
        (HorizonSettings, {"turned": 0.31}, "turned"),
        (Uncertainty, {"quantile": 0.3}, "quantile"),
        (Uncertainty, {"age": -1.0}, "age"),
    ],
)
def test_impossible_settings_are_refused(
    settings: type, values: dict[str, Any], field: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        settings(**values)
    assert caught.value.field == field


def speeds(model: Model, ground: ElevationMap, path: CandidatePath) -> np.ndarray:
    survived = Uncertainty()
    solved = time_optimal_batch(
        ground, batch([path], 0.25), survived.cautious(model), uncertainty=survived
    )
    return np.sqrt(solved.speed_sq[:, 0])


@settings(max_examples=25)
@given(
    tables=generated.tables(),
    heights=generated.heights(),
    path=generated.paths(10.0),
    level=st.sampled_from([0.5, 0.8, 1.0]),
    value=between(0.0, 0.3),
    std=between(0.0, 0.1),
    more=between(0.01, 0.2),
)
def test_a_vague_motion_resistance_never_makes_it_faster(
    tables: dict,
    heights: object,
    path: CandidatePath,
    level: float,
    value: float,
    std: float,
    more: float,
) -> None:
    model = model_of(tables)
    model = replace(model, braking=replace(model.braking, level=level))
    ground = ground_map(heights, x=(-8.0, 18.0), y=(-11.0, 11.0))
    fast, slow = (
        speeds(model_on(model, Features(motion_resistance=TerrainEstimate(value, s))), ground, path)
        for s in (std, std + more)
    )
    # Plans come to rest at stations only, and what is given up moves with the one where they do.
    assert np.all(slow <= np.maximum(fast, np.append(fast[:1], fast[:-1])) + 0.02)


def test_no_bound_is_left_out() -> None:
    assert {scene.label for scene in SCENES.values()} == {bound.label for bound in Limiting}
    assert list(BOUNDS) == list(Limiting)


def test_an_axle_that_would_lift_ahead_is_no_rollover() -> None:
    gravel = {"b_b": 0.4, "m_b": 0.08}
    tables = tables_with(
        vehicle={"cg_z": 0.8}, braking={"dead_time": 0.75, "terrain": {"gravel": gravel}}
    )
    ground = ground_map(
        lambda x, y: 0.0 * x,
        classes=lambda x, y: (abs(x - 10.0) < 0.4).astype(int),
        class_names=("", "gravel"),
    )
    named = labels(plan_one(tables, ground, straight(30.0), start_speed=3.0))
    assert "tip_over" in named
    assert "rollover" not in named


@pytest.mark.parametrize("limiting", Limiting)
def test_what_the_registry_says_of_a_bound_is_there(limiting: Limiting) -> None:
    """Its law can be found, its label and colours can be shown, and a what-if run can lift it."""
    bound = BOUNDS[limiting]
    module, name = bound.law.split(":")
    assert callable(getattr(importlib.import_module(module), name))
    assert bound.meaning
    assert not bound.meaning.endswith(".")
    for colour in (bound.colour, bound.colour_on_dark or bound.colour):
        assert re.fullmatch("#[0-9a-f]{6}", colour)
    model = model_of(tables_with(braking={"sliding_friction": 0.6}))
    assumptions = Assumptions(model=model, uncertainty=None, clear=np.inf)
    lifted = without(limiting, assumptions)
    assert lifted != assumptions
    if bound.lift.out_of_reach or bound.lift.relaxation:
        assert lifted.relax is not None
        assert lifted.relax(model) != model or limiting is Limiting.SPEED_LIMIT


@pytest.mark.parametrize("name", SCENES)
def test_each_bound_bites_and_lets_go(name: str) -> None:
    scene = SCENES[name]
    freed = scene.freed()
    plan, free = scene.bitten(), freed.bitten()
    assert plan.status is scene.status, plan.reason
    assert scene.says in plan.reason
    assert_sound(plan, scene.tables, scene.ground)
    bitten = np.flatnonzero([label == scene.label for label in labels(plan)])
    assert len(bitten) >= scene.share * len(plan.station), labels(plan)
    assert (free.status, free.reason) == (Status.OK, "")
    assert_sound(free, freed.tables, freed.ground)
    # Stopping at the end of the path is a stopping path, and changes of acceleration take time.
    moving = free.speed > 0.5
    if scene.label not in ("stopping_path", "accel", "decel", "jerk"):
        assert scene.label not in np.array(labels(free))[moving]
    if scene.status is Status.BLOCKED:
        assert plan.progress < free.progress - 0.5
    else:
        assert plan.travel_time > 1.01 * free.travel_time
    # Where the bound bites the vehicle is slower than without it.
    slower = [plan.speed[k] <= at(free, plan.station[k], free.speed) + 0.02 for k in bitten]
    assert np.mean(slower) > 0.8


def test_limits_of_segments_are_those_of_one_candidate() -> None:
    solved = time_optimal_batch(plane(), batch([straight(9.0)], 0.25), model_of(ATV))
    column = CandidateColumn(solved, 0, solved.start_sq)
    two = {
        name: np.repeat(value, 2, axis=-1)
        for name, value in column.problem._asdict().items()
        if isinstance(value, np.ndarray)
    }
    column.problem = column.problem._replace(**two)
    with pytest.raises(ValueError, match="expected that of the track, of one candidate"):
        column.segment_limits(solved.profile_of(0))
