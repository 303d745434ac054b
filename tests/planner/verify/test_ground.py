"""Verification over ground, and of a batch as of single plans."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.planner.ground.braking_ground import StopErrors
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import PathBatch, batch
from slopewise.planner.pipeline.band_bounds import BandGround
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.candidates import finished
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from slopewise.planner.plan import Status
from slopewise.planner.verify.terms import terms_of
from slopewise.planner.verify.verifier import Violations, check, screen, track_of
from tests.world import generated
from tests.world.generated import between
from tests.world.ground import Height, arc, ground_map, plane, straight
from tests.world.vehicles import Tables, model_of, tables_with

FACE = 10.0
"""Where the ground changes [m]."""

FRONT, HALF = 0.88, 0.6
"""Of the quad: end of its body and front wheels, from the middle of the wheelbase [m]."""


@dataclass(frozen=True)
class Scene:
    """Ground, the bound that it belongs to, and where at the latest a vehicle is blocked [m]."""

    bound: Limiting
    height: Height
    blocked: float
    unknown: Height | None = None
    changes: Tables = field(default_factory=dict)
    message: str = ""


def post(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.where((np.abs(x - FACE) < 0.16) & (np.abs(y) < 0.16), 0.5, 0.0)


STEEP = {"grade_range": [-0.6, 0.6], "roll_range": [-0.6, 0.6], "extrapolate": False}
SCENES = {
    "unknown ground": Scene(
        Limiting.UNKNOWN_TERRAIN,
        lambda x, y: 0.0 * x,
        FACE - 0.5,
        lambda x, y: x > FACE,
        message="unknown ground",
    ),
    "a grade beyond the trained ones": Scene(
        Limiting.MODEL_VALIDITY,
        lambda x, y: 0.4 * np.maximum(x - FACE, 0.0),
        FACE + 0.6,
        message="untrained slope",
    ),
    "a bank beyond the trained ones": Scene(
        Limiting.MODEL_VALIDITY,
        lambda x, y: 0.35 * y * np.clip((x - FACE) / 4.0, 0.0, 1.0),
        FACE + 4.0,
        message="untrained slope",
    ),
    "a slope that weak brakes do not hold": Scene(
        Limiting.HOLDING,
        lambda x, y: 0.3 * np.maximum(x - FACE, 0.0),
        FACE + 0.6,
        changes={"braking": {"m_b": 0.0, "b_b": 0.2, "b_m": 0.0, "m_m": 0.0} | STEEP},
        message="to be held on",
    ),
    "a slope with too little friction": Scene(
        Limiting.HOLDING,
        lambda x, y: 0.3 * np.maximum(x - FACE, 0.0),
        FACE + 0.6,
        changes={"braking": {"sliding_friction": 0.2} | STEEP},
        message="to be held on",
    ),
    "a step up": Scene(
        Limiting.STEP, lambda x, y: np.where(x > FACE, 0.2, 0.0), FACE, message="a step of 0.1"
    ),
    "a drop": Scene(
        Limiting.STEP, lambda x, y: np.where(x > FACE, -0.2, 0.0), FACE, message="a step of 0.1"
    ),
    "a hole under one wheel": Scene(
        Limiting.STEP,
        lambda x, y: np.where((x > FACE) & (x < FACE + 1.0) & (y > 0.2), -0.25, 0.0),
        FACE + 0.3,
    ),
    "a ridge between the axles": Scene(
        Limiting.CLEARANCE,
        lambda x, y: np.maximum(0.46 - 0.55 * np.abs(x - FACE), 0.0),
        FACE + 0.2,
        changes={
            "braking": {"m_b": 0.0, "b_b": 0.8, "b_m": 0.0, "m_m": 0.0} | STEEP,
            "vehicle": {"front_overhang": 0.05, "rear_overhang": 0.05, "cg_z": 0.3},
        },
        message="between the wheels",
    ),
    "a post": Scene(Limiting.BODY, post, FACE - FRONT + 0.3, message="under the body"),
}


def solved_on(ground: ElevationMap, scene: Scene) -> TimeOptimalBatch:
    model = model_of(tables_with(**scene.changes))
    return time_optimal_batch(ground, batch([straight(20.0)], 0.1), model)


def maps(scene: Scene) -> tuple[ElevationMap, ElevationMap]:
    """Level ground and that of the scene."""
    size = {"x": (-3.0, 24.0), "y": (-3.0, 3.0), "resolution": 0.1}
    there = ground_map(scene.height, unknown=scene.unknown, **size)
    return ground_map(lambda x, y: 0.0 * x, **size), there


@pytest.mark.parametrize("name", SCENES)
def test_a_plan_whose_bounds_saw_nothing_stops_before_it_all_the_same(name: str) -> None:
    """All bounds of the ground are lifted: they were computed on a level map."""
    scene = SCENES[name]
    level, there = maps(scene)
    blind = solved_on(level, scene)
    free = finished(blind, 0, "free", smooth=True)
    assert free.status is Status.OK
    plan = finished(replace(blind, around=BandGround(there, InputErrors())), 0, "p", smooth=True)
    assert plan.status is Status.BLOCKED, plan.reason
    assert scene.message in plan.reason
    assert "found by the verifier" in plan.reason
    assert FACE - FRONT - 0.7 < plan.clear_distance <= scene.blocked
    moving = plan.speed > 0.0
    assert np.all((plan.station + plan.stop_distance)[moving] <= plan.clear_distance + 1e-6)
    assert plan.progress > 5.0
    assert np.all(plan.speed <= free.speed + 1e-4)


@pytest.mark.parametrize("name", SCENES)
def test_a_clear_distance_that_is_too_long_is_a_violation_of_its_kind(name: str) -> None:
    """The rest of the bounds is that of the scene; the profile is that of level ground."""
    scene = SCENES[name]
    level, there = maps(scene)
    honest, blind = solved_on(there, scene), solved_on(level, scene)
    assert CandidateColumn(honest, 0, np.zeros(1)).blocked is None
    bounds = replace(honest.bounds, clear_distance=honest.bounds.clear_distance + 4.0)
    column = CandidateColumn(replace(honest, bounds=bounds), 0, np.zeros(1))
    assert column.blocked is not None
    assert column.blocked.bound is scene.bound
    assert column.blocked.station >= honest.bounds.clear_distance[0]
    violation = column.verify(blind.profile_of(0)).violation._asdict()
    kind = scene.bound.label
    assert violation[kind] > 1.0
    assert violation["overrun"] == 0.0


SMALLER = {
    "a step that it climbs": lambda x, y: np.where(x > FACE, 0.085, 0.0),
    "a ramp": lambda x, y: 0.24 * np.clip(x - FACE, 0.0, 1.5),
    "a narrow crack": lambda x, y: np.where(np.abs(x - FACE) < 0.09, -0.4, 0.0),
    "a stone that it straddles": lambda x, y: 0.4 * post(x, y),
    "a bank": lambda x, y: 0.2 * y,
}


@pytest.mark.parametrize("name", SMALLER)
def test_ground_that_it_can_pass_blocks_nothing(name: str) -> None:
    scene = Scene(Limiting.STEP, SMALLER[name], FACE)
    _, there = maps(scene)
    assert CandidateColumn(solved_on(there, scene), 0, np.zeros(1)).blocked is None
    level_bounds = replace(
        solved_on(maps(scene)[0], scene), around=BandGround(there, InputErrors())
    )
    assert CandidateColumn(level_bounds, 0, np.zeros(1)).blocked is None


def test_the_band_of_tracking_x_at_as_well() -> None:
    scene = Scene(Limiting.BODY, lambda x, y: post(x, y - 0.9), FACE)
    level, there = maps(scene)
    blind = solved_on(level, scene)
    findings = [
        CandidateColumn(replace(blind, around=BandGround(there, errors)), 0, np.zeros(1)).blocked
        for errors in (InputErrors(), InputErrors(cross_track=0.3))
    ]
    assert findings[0] is None
    assert findings[1] is not None
    assert findings[1].bound is Limiting.BODY


def verdicts(
    solved: TimeOptimalBatch, paths: PathBatch, speed_sq: np.ndarray, model: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Worst breaches (M, 8) of the batch's judge and of the single one."""
    profile, ground, bounds = solved.profile, solved.ground, solved.bounds
    together = screen(profile, ground, bounds, speed_sq, model, paths.speed_limit)
    single = [
        check(
            track_of(profile, ground, j, paths.speed_limit),
            np.ascontiguousarray(speed_sq[: paths.count[j], j]),
            float(bounds.clear_distance[j]),
            float(ground.distance_offset[j]),
            terms_of(model, ground.motion, StopErrors()),
        ).violation
        for j in range(len(paths.names))
    ]
    return together, np.array(single)


def assert_agree(together: np.ndarray, single: np.ndarray) -> None:
    """The same violations; amounts are those of the single verifier, which may find more load
    where nothing is near its limit for the batch."""
    assert together.shape == single.shape == (len(single), len(Violations._fields))
    assert np.array_equal(together.max(axis=1) > 0.0, single.max(axis=1) > 0.0)
    assert together == pytest.approx(single, abs=2e-6)


@settings(max_examples=40)
@given(
    generated.tables(),
    generated.effects(),
    generated.heights(),
    st.lists(between(-0.3, 0.3), min_size=1, max_size=4),
    between(3.0, 12.0),
    between(0.0, 3.0),
    st.sampled_from([0.8, 1.0, 1.0, 1.05, 1.5]),
)
def test_the_batch_is_verified_as_each_candidate_alone(
    tables: Any,
    effects: Any,
    height: Any,
    curvatures: list[float],
    clear: float,
    start: float,
    share: float,
) -> None:
    tables["effect"] = effects
    model = model_of(tables)
    fan = [
        arc(6.0 + i, k, name=f"{i}") if abs(k) > 1e-3 else straight(6.0 + i, name=f"{i}")
        for i, k in enumerate(curvatures)
    ]
    paths = batch(fan, 0.25)
    ground = ground_map(height, x=(-4.0, 16.0), y=(-14.0, 14.0))
    solved = time_optimal_batch(ground, paths, model, start_speed=start, clear=clear)
    assert_agree(*verdicts(solved, paths, share * solved.speed_sq, model))


SIDE = {"min_load": 0.5, "lateral_accel": 9.0}


@pytest.mark.parametrize(
    ("kind", "changes", "share"),
    [
        ("overrun", {"limits": {"decel": 6.0}}, 1.2),
        ("speed", {"limits": {"speed": 1.5}}, 1.2),
        ("lateral", {"limits": {"lateral_accel": 0.3}}, 1.2),
        ("wheel_speed", {"vehicle": {"max_wheel_speed": 2.0}}, 1.2),
        ("accel", {}, 1.2),
        ("decel", {}, 1.2),
        ("wheel_load", {"vehicle": {"cg_z": 1.1}, "limits": {"min_load": 0.15}}, 1.6),
        ("side_load", {"vehicle": {"track_width": 0.4}, "limits": SIDE}, 6.0),
    ],
)
def test_each_kind_of_breach_is_found_in_the_right_candidate(
    kind: str, changes: dict[str, Any], share: float
) -> None:
    model = model_of(tables_with(**changes))
    paths = batch([arc(12.0, 0.15, name="first"), arc(15.0, 0.15, name="second")], 0.25)
    solved = time_optimal_batch(plane(y=(-14.0, 14.0)), paths, model, clear=10.0)
    speed_sq = solved.speed_sq * np.array([1.0, share])
    together, single = verdicts(solved, paths, speed_sq, model)
    assert_agree(together, single)
    assert together[0].max() == 0.0
    assert together[1, Violations._fields.index(kind)] > 0.0
