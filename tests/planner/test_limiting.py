"""Every bound has a scene in which it bites, and one with one thing changed in which it must not.

Both plans have to pass the checker, and the one that is limited is slower or ends earlier.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.explain.relaxed import without
from slopewise.planner.explain.what_if import Assumptions
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.planner.scenes import (
    Tables,
    arc,
    assert_sound,
    at,
    ground_map,
    labels,
    model_of,
    plan_one,
    plane,
    straight,
    tables_with,
)

LONG = {"x": (-3.0, 65.0)}
BRISK = {"accel": 3.0, "decel": 3.0, "jerk": 30.0}
STRONG = {"max_drive_force": 9000.0, "max_drive_power": 90_000.0, "max_wheel_speed": 20.0}


def plane_with(height: Callable[[np.ndarray, np.ndarray], Any]) -> ElevationMap:
    """Cells finer than a wheel."""
    return ground_map(height, resolution=0.1)


@dataclass(frozen=True)
class Scene:
    """A planned scene, and the one change that removes the bound."""

    label: str
    tables: Tables
    free_tables: Tables
    ground: ElevationMap = field(default_factory=plane)
    free_ground: ElevationMap | None = None
    path: CandidatePath = field(default_factory=lambda: straight(35.0))
    free_path: CandidatePath | None = None
    options: dict[str, Any] = field(default_factory=dict)
    free_options: dict[str, Any] | None = None
    share: float = 0.1
    status: Status = Status.OK
    says: str = ""

    def bitten(self) -> SpeedPlan:
        return plan_one(self.tables, self.ground, self.path, **self.options)

    def free(self) -> SpeedPlan:
        options = self.options if self.free_options is None else self.free_options
        ground = self.ground if self.free_ground is None else self.free_ground
        return plan_one(self.free_tables, ground, self.free_path or self.path, **options)


def same(tables: Tables) -> dict[str, Tables]:
    return {"tables": tables, "free_tables": tables}


def limits(**values: float) -> Tables:
    return tables_with(limits=values)


FAST = {"speed_range": [1.0, 30.0], "m_b": 0.0}
LONG_BASE = {"wheelbase": 3.0, "cg_x": 1.5}
TIPPY = {"cg_z": 0.72, **STRONG}
GROWING = {"m_b": 0.08, "b_b": 0.42, "m_m": 0.0, "b_m": 0.0, "speed_range": [0.5, 6.0]}
TIPPY_LIMITS = BRISK | {"min_load": 0.2, "speed": 6.0, "lateral_accel": 20.0}

SCENES: dict[str, Scene] = {
    "speed limit of the model": Scene(
        "speed_limit",
        tables_with(limits={"speed": 1.5}, braking=FAST),
        tables_with(limits={"speed": 30.0}, braking=FAST),
        share=0.5,
    ),
    "speed limit of the path": Scene(
        "speed_limit",
        **same(tables_with(limits={"speed": 30.0}, braking=FAST)),
        path=straight(35.0, speed_limit=np.array([1.5, 1.5])),
        free_path=straight(35.0),
        share=0.5,
    ),
    "stopping path before unknown ground": Scene(
        "stopping_path",
        **same(limits(decel=9.0, jerk=100.0)),
        ground=plane(unknown=lambda x, y: x > 20.0),
        free_ground=plane(),
        share=0.03,
        status=Status.BLOCKED,
    ),
    "stopping path before the end of the known path": Scene(
        "stopping_path",
        **same(limits(decel=9.0, jerk=100.0)),
        options={"clear": 12.0},
        free_options={},
        share=0.03,
        status=Status.BLOCKED,
        says="the way is known to be free for its front only up to",  # words: ok
    ),
    "tip-over by the speed at brake onset": Scene(
        "tip_over",
        tables_with(vehicle=TIPPY, braking=GROWING, limits=TIPPY_LIMITS),
        tables_with(vehicle=TIPPY | {"cg_z": 0.5}, braking=GROWING, limits=TIPPY_LIMITS),
        ground=plane(rise=-0.2, **LONG),
        path=straight(55.0),
        share=0.5,
    ),
    "tip-over downhill, standing": Scene(
        "tip_over",
        **same(
            tables_with(
                vehicle={"cg_z": 0.8},
                limits={"min_load": 0.3},
                braking={"b_m": 0.0, "m_m": 0.0, "m_b": 0.0, "b_b": 0.515},
            )
        ),
        ground=ground_map(lambda x, y: -0.22 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="an axle keeps too little load on grade -",
    ),
    "tip-over uphill, standing": Scene(
        "tip_over",
        **same(
            tables_with(
                vehicle={"cg_z": 1.1, "cg_x": 0.4} | STRONG,
                limits={"min_load": 0.45},
                braking={"b_b": 0.3, "m_b": 0.0},
            )
        ),
        ground=ground_map(lambda x, y: 0.22 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="an axle keeps too little load on grade",
    ),
    "rollover in a turn": Scene(
        "rollover",
        tables_with(
            vehicle=LONG_BASE | STRONG | {"cg_z": 1.4},
            limits=BRISK | {"min_load": 0.4, "lateral_accel": 20.0},
        ),
        tables_with(
            vehicle=LONG_BASE | STRONG | {"cg_z": 0.3},
            limits=BRISK | {"min_load": 0.4, "lateral_accel": 20.0},
        ),
        path=arc(6.5, 0.4),
        share=0.2,
    ),
    "rollover standing across a slope": Scene(
        "rollover",
        **same(
            tables_with(
                vehicle=LONG_BASE | {"cg_z": 0.9, "wheel_travel": 0.5}, limits={"min_load": 0.4}
            )
        ),
        ground=ground_map(lambda x, y: 0.4 * y * np.clip((x - 15.0) / 5.0, 0.0, 1.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="keeps too little load on roll",
    ),
    "lateral acceleration": Scene(
        "lateral",
        limits(lateral_accel=0.4),
        limits(lateral_accel=20.0),
        path=arc(7.0, 0.3),
        share=0.3,
    ),
    "wheel speed, straight on": Scene(
        "wheel_speed",
        tables_with(vehicle={"max_wheel_speed": 2.0}),
        tables_with(vehicle={"max_wheel_speed": 9.0}),
        share=0.5,
    ),
    "wheel speed by the slip track of a skid-steer": Scene(
        "wheel_speed",
        tables_with(
            vehicle={"max_wheel_speed": 1.5},
            terrain={"slip_track": 3.0},
            limits={"lateral_accel": 20.0, "speed": 1.2},
        ),
        tables_with(
            vehicle={"max_wheel_speed": 1.5, "drive": "ackermann"},
            terrain={"slip_track": 3.0},
            limits={"lateral_accel": 20.0, "speed": 1.2},
        ),
        path=arc(8.0, 0.4),
        share=0.5,
    ),
    "power on a grade": Scene(
        "traction",
        tables_with(vehicle={"max_drive_power": 2500.0}),
        tables_with(vehicle={"max_drive_power": 90_000.0}),
        ground=plane(rise=0.15),
        share=0.3,
    ),
    "thrust that leaves little to accelerate": Scene(
        "traction",
        tables_with(vehicle=STRONG | {"max_drive_force": 1500.0}),
        tables_with(vehicle=STRONG),
        ground=plane(rise=0.12),
        share=0.1,
    ),
    "a hill the drive cannot climb": Scene(
        "traction",
        **same(tables_with(vehicle={"max_drive_force": 1200.0})),
        ground=ground_map(lambda x, y: 0.2 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="N of thrust, the drive has 1200 N",
    ),
    "turning resistance no drive overcomes": Scene(
        "traction",
        tables_with(vehicle={"max_drive_force": 1500.0}, terrain={"lateral_resistance": 1.0}),
        tables_with(
            vehicle={"max_drive_force": 1500.0, "drive": "ackermann"},
            terrain={"lateral_resistance": 1.0},
        ),
        path=arc(8.0, 0.5),
        share=0.01,
        status=Status.BLOCKED,
        says="N of thrust",
    ),
    "acceleration": Scene(
        "accel",
        tables_with(vehicle=STRONG, limits={"accel": 0.4, "jerk": 50.0}),
        tables_with(vehicle=STRONG, limits={"accel": 30.0, "jerk": 1e4}),
        path=straight(10.0),
        share=0.3,
    ),
    "front axle lifting under drive uphill": Scene(
        "traction",
        tables_with(
            vehicle=STRONG | {"cg_z": 0.8, "cg_x": 0.45},
            limits={"accel": 4.0, "min_load": 0.4, "jerk": 100.0},
        ),
        tables_with(
            vehicle=STRONG | {"cg_z": 0.3}, limits={"accel": 4.0, "min_load": 0.4, "jerk": 100.0}
        ),
        ground=plane(rise=0.15),
        share=0.1,
    ),
    "service braking": Scene(
        "decel",
        limits(decel=0.5, jerk=30.0, accel=3.0),
        limits(decel=30.0, jerk=1e4, accel=3.0),
        path=straight(15.0),
        share=0.3,
    ),
    "brakes on a steep downhill": Scene(
        "decel",
        tables_with(braking={"b_b": 0.3, "b_m": 0.0}, limits={"decel": 1.5, "jerk": 50.0}),
        tables_with(braking={"b_b": 0.6, "b_m": 0.0}, limits={"decel": 30.0, "jerk": 1e4}),
        ground=plane(rise=-0.22),
        share=0.1,
    ),
    "jerk": Scene(
        "jerk",
        limits(jerk=0.5),
        limits(jerk=1e4),
        share=0.1,
    ),
    "unknown ground across the path": Scene(
        "unknown_terrain",
        **same(tables_with()),
        ground=plane(unknown=lambda x, y: np.abs(x - 20.0) < 0.3),
        free_ground=plane(),
        share=0.1,
        status=Status.BLOCKED,
        says="unknown ground under the body",
    ),
    "unknown ground under one wheel only": Scene(
        "unknown_terrain",
        **same(tables_with()),
        ground=plane(resolution=0.1, unknown=lambda x, y: np.hypot(x - 20.0, y - 0.5) < 0.12),
        free_ground=plane(resolution=0.1, unknown=lambda x, y: np.hypot(x - 20.0, y - 0.85) < 0.12),
        share=0.1,
        status=Status.BLOCKED,
        says="unknown ground under the body",
    ),
    "the edge of the map": Scene(
        "unknown_terrain",
        **same(tables_with()),
        ground=plane(x=(-3.0, 20.0)),
        free_ground=plane(),
        share=0.1,
        status=Status.BLOCKED,
        says="unknown ground under the",
    ),
    "trained speeds": Scene(
        "model_validity",
        tables_with(braking={"speed_range": [0.5, 1.5]}),
        tables_with(braking={"speed_range": [0.5, 4.0]}),
        share=0.5,
    ),
    "ground steeper than trained": Scene(
        "model_validity",
        **same(tables_with(braking={"grade_range": [-0.05, 0.05]})),
        ground=ground_map(lambda x, y: 0.1 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.1,
        status=Status.BLOCKED,
        says="is outside the trained -2.9° … 2.9°",
    ),
    "a side slope beyond the trained rolls": Scene(
        "model_validity",
        **same(tables_with(braking={"roll_range": [-0.05, 0.05]})),
        ground=ground_map(lambda x, y: 0.08 * y * np.clip(x - 15.0, 0.0, 1.0)),
        free_ground=plane(),
        share=0.1,
        status=Status.BLOCKED,
        says="outside the trained -2.9°",
    ),
    "a ridge": Scene(
        "crest",
        **same(
            tables_with(
                vehicle=STRONG, limits=BRISK | {"speed": 6.0}, braking={"speed_range": [1.0, 6.0]}
            )
        ),
        ground=ground_map(lambda x, y: -0.2 * np.abs(x - 18.0), resolution=0.5),
        free_ground=plane(),
        share=0.005,
    ),
    "a turn on ice": Scene(
        "friction",
        tables_with(braking={"sliding_friction": 0.35}, limits=BRISK | {"lateral_accel": 9.0}),
        tables_with(limits=BRISK | {"lateral_accel": 9.0}),
        ground=plane(x=(-20.0, 20.0), y=(-3.0, 20.0)),
        path=arc(25.0, 0.15),
        share=0.02,
    ),
    "a slope that the brakes do not hold": Scene(
        "holding",
        tables_with(braking={"b_b": 0.12, "b_m": 0.0}),
        tables_with(braking={"b_b": 0.3, "b_m": 0.0}),
        ground=ground_map(lambda x, y: 0.16 * np.clip(x - 15.0, 0.0, None)),
        share=0.05,
        status=Status.BLOCKED,
        says="the brakes do not hold on grade 8",
    ),
    "a step across the path": Scene(
        "step",
        **same(tables_with()),
        ground=plane_with(lambda x, y: 0.15 * (x > 20.0)),
        free_ground=plane_with(lambda x, y: 0.06 * (x > 20.0)),
        share=0.1,
        status=Status.BLOCKED,
        says="m up under the front",
    ),
    "a rock between the wheels": Scene(
        "clearance",
        **same(tables_with(vehicle={"front_overhang": 0.0, "wheelbase": 1.25, "cg_x": 0.625})),
        ground=plane_with(lambda x, y: 0.4 * (np.hypot(x - 20.0, y) < 0.2)),
        free_ground=plane_with(lambda x, y: 0.15 * (np.hypot(x - 20.0, y) < 0.2)),
        share=0.1,
        status=Status.BLOCKED,
        says="m high between the wheels",
    ),
    "a rock before the front overhang": Scene(
        "body",
        **same(tables_with(vehicle={"front_overhang": 0.6})),
        ground=plane_with(lambda x, y: 0.4 * (np.hypot(x - 20.0, y) < 0.2)),
        free_ground=plane_with(lambda x, y: 0.15 * (np.hypot(x - 20.0, y) < 0.2)),
        share=0.1,
        status=Status.BLOCKED,
        says="m high under the front overhang",
    ),
    "a washboard": Scene(
        "roughness",
        **same(tables_with()),
        ground=plane_with(lambda x, y: 0.04 * np.sin(2.0 * np.pi * x / 1.5)),
        free_ground=plane_with(lambda x, y: 0.04 * np.sin(2.0 * np.pi * x / 15.0)),
        share=0.3,
    ),
}


def test_no_bound_is_left_out() -> None:
    assert {scene.label for scene in SCENES.values()} == {bound.label for bound in Limiting}
    assert list(BOUNDS) == list(Limiting)


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


def test_colours_of_bounds_are_distinct() -> None:
    assert len({bound.colour for bound in BOUNDS.values()}) == len(BOUNDS)


@pytest.mark.parametrize("name", SCENES)
def test_each_bound_bites(name: str) -> None:
    scene = SCENES[name]
    plan = scene.bitten()
    assert plan.status is scene.status, plan.reason
    assert scene.says in plan.reason
    assert_sound(plan, scene.tables, scene.ground)
    assert np.mean([label == scene.label for label in labels(plan)]) >= scene.share, labels(plan)


@pytest.mark.parametrize("name", SCENES)
def test_each_bound_lets_go(name: str) -> None:
    scene = SCENES[name]
    plan, free = scene.bitten(), scene.free()
    assert free.status is Status.OK, free.reason
    assert free.reason == ""
    assert_sound(free, scene.free_tables, scene.free_ground or scene.ground)
    # Stopping at the end of the path is a stopping path, and changes of acceleration take time.
    moving = free.speed > 0.5
    if scene.label not in ("stopping_path", "accel", "decel", "jerk"):
        assert scene.label not in np.array(labels(free))[moving]
    if scene.status is Status.BLOCKED:
        assert plan.progress < free.progress - 0.5
    else:
        assert plan.travel_time > 1.01 * free.travel_time
    # Where the bound bites the vehicle is slower than without it.
    bitten = np.flatnonzero([label == scene.label for label in labels(plan)])
    slower = [plan.speed[k] <= at(free, plan.station[k], free.speed) + 0.02 for k in bitten]
    assert np.mean(slower) > 0.8


def test_extrapolation_continues_where_training_ends_but_slower() -> None:
    steep = ground_map(lambda x, y: -0.15 * np.maximum(x - 10.0, 0.0))
    wide = tables_with(limits={"decel": 9.0, "jerk": 50.0})
    narrow = tables_with(
        braking={"grade_range": [-0.05, 0.05]}, limits={"decel": 9.0, "jerk": 50.0}
    )
    brave = tables_with(
        braking={"grade_range": [-0.05, 0.05], "extrapolate": True, "extrapolation_margin": 0.3},
        limits={"decel": 9.0, "jerk": 50.0},
    )
    path = straight(25.0)
    trained, stopped, going = (plan_one(t, steep, path) for t in (wide, narrow, brave))
    assert (trained.status, stopped.status, going.status) == (
        Status.OK,
        Status.BLOCKED,
        Status.OK,
    )
    assert stopped.progress < 10.0
    assert going.travel_time > 1.02 * trained.travel_time
    moving = (going.speed > 0.0) & (trained.speed > 0.0) & (going.station > 11.0)
    assert np.all(going.stop_distance[moving] > 0.0)
    assert_sound(going, brave, steep)
    # The margin is the named one: the same brakes at 70 % stop in the same distance.
    k = int(np.flatnonzero(moving & (going.station > 13.0))[0])
    theta = np.arctan(-0.15)
    v = going.speed[k]
    force = 0.7 * ((-0.03 * v - 0.35) * theta + 0.015 * v + 0.40)
    stop = v * 0.3 + v**2 / (2.0 * 9.80665 * (force + np.sin(theta))) + 0.2
    assert going.stop_distance[k] == pytest.approx(stop, abs=2e-3)


def test_a_patch_of_ice_is_braked_for_ahead_and_an_unknown_class_like_the_worst() -> None:
    tables = limits(decel=9.0, jerk=100.0)
    tables["braking"]["terrain"] = {
        "ice": {"b_b": 0.12, "m_b": 0.0, "b_m": 0.0, "m_m": 0.0},
        "sand": {"b_b": 0.5},
    }

    def crossing(name: str) -> ElevationMap:
        return plane(
            classes=lambda x, y: (x > 20.0) & (x < 24.0), class_names=("", name), resolution=0.1
        )

    path = straight(24.0)
    dry, ice, sand, strange = (
        plan_one(tables, crossing(name), path) for name in ("", "ice", "sand", "moon dust")
    )
    assert at(ice, 18.0, ice.speed) < 0.9 * at(dry, 18.0, dry.speed)
    assert at(ice, 8.0, ice.speed) == pytest.approx(at(dry, 8.0, dry.speed), abs=1e-2)
    assert at(sand, 18.0, sand.speed) == pytest.approx(at(dry, 18.0, dry.speed), abs=0.05)
    np.testing.assert_allclose(strange.speed, ice.speed, atol=1e-3)
    for plan, name in ((ice, "ice"), (strange, "moon dust")):
        assert_sound(plan, tables, crossing(name))


def test_the_order_of_the_names_breaks_ties() -> None:
    """Two bounds of the same height: the earlier name is reported, every time."""
    tables = tables_with(vehicle={"max_wheel_speed": 2.0}, limits={"speed": 2.0})
    plan = plan_one(tables, plane(), straight(30.0), PlannerSettings(smooth=False))
    k = int(np.argmin(np.abs(plan.station - 15.0)))
    assert labels(plan)[k] == "speed_limit"
