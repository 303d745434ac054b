"""A scene in which each bound bites, and the one change that removes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.plan import SpeedPlan, Status
from tests.world.ground import arc, ground_map, plane, straight
from tests.world.plans import plan_one
from tests.world.vehicles import Tables, tables_with

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
    free_tables: Tables | None = None
    ground: ElevationMap = field(default_factory=plane)
    free_ground: ElevationMap | None = None
    path: CandidatePath = field(default_factory=lambda: straight(35.0))
    share: float = 0.1
    status: Status = Status.OK
    says: str = ""

    def bitten(self) -> SpeedPlan:
        return plan_one(self.tables, self.ground, self.path)

    def freed(self) -> Scene:
        tables, ground = self.free_tables or self.tables, self.free_ground or self.ground
        return replace(self, tables=tables, ground=ground)


def turn_after(length: float, radius: float) -> CandidatePath:
    """A straight, then a quarter of a turn to the left [m]."""
    angle = np.linspace(0.0, 0.5 * np.pi, 60)
    x = np.concatenate((np.arange(0.0, length, 0.1), length + radius * np.sin(angle)))
    y = np.concatenate((0.0 * np.arange(0.0, length, 0.1), radius * (1.0 - np.cos(angle))))
    return CandidatePath("turn", np.column_stack([x, y]))


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
    "stopping path before unknown ground": Scene(
        "stopping_path",
        limits(decel=9.0, jerk=100.0),
        ground=plane(unknown=lambda x, y: x > 20.0),
        free_ground=plane(),
        share=0.03,
        status=Status.BLOCKED,
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
        tables_with(
            vehicle={"cg_z": 0.8},
            limits={"min_load": 0.3},
            braking={"b_m": 0.0, "m_m": 0.0, "m_b": 0.0, "b_b": 0.515},
        ),
        ground=ground_map(lambda x, y: -0.22 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="an axle keeps too little load on grade -",
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
        ground=plane(y=(-6.0, 9.0)),
        path=arc(6.5, 0.4),
        share=0.2,
    ),
    "rollover standing across a slope": Scene(
        "rollover",
        tables_with(
            vehicle=LONG_BASE | {"cg_z": 0.9, "wheel_travel": 0.5}, limits={"min_load": 0.4}
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
        ground=plane(y=(-6.0, 9.0)),
        path=arc(7.0, 0.3),
        share=0.3,
    ),
    "wheel speed, straight on": Scene(
        "wheel_speed",
        tables_with(vehicle={"max_wheel_speed": 2.0}),
        tables_with(vehicle={"max_wheel_speed": 9.0}),
        share=0.5,
    ),
    "power on a grade": Scene(
        "traction",
        tables_with(vehicle={"max_drive_power": 2500.0}),
        tables_with(vehicle={"max_drive_power": 90_000.0}),
        ground=plane(rise=0.15),
        share=0.3,
    ),
    "a hill the drive cannot climb": Scene(
        "traction",
        tables_with(vehicle={"max_drive_force": 1200.0}),
        ground=ground_map(lambda x, y: 0.2 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        share=0.01,
        status=Status.BLOCKED,
        says="N of thrust, the drive has 1200 N",
    ),
    "acceleration": Scene(
        "accel",
        tables_with(vehicle=STRONG, limits={"accel": 0.4, "jerk": 50.0}),
        tables_with(vehicle=STRONG, limits={"accel": 30.0, "jerk": 1e4}),
        path=straight(10.0),
        share=0.3,
    ),
    "service braking": Scene(
        "decel",
        limits(decel=0.5, jerk=30.0, accel=3.0),
        limits(decel=30.0, jerk=1e4, accel=3.0),
        path=straight(15.0),
        share=0.3,
    ),
    "jerk": Scene("jerk", limits(jerk=0.1), limits(jerk=1e4)),
    "unknown ground across the path": Scene(
        "unknown_terrain",
        tables_with(),
        ground=plane(unknown=lambda x, y: np.abs(x - 20.0) < 0.3),
        free_ground=plane(),
        status=Status.BLOCKED,
        says="unknown ground under the body",
    ),
    "ground steeper than trained": Scene(
        "model_validity",
        tables_with(braking={"grade_range": [-0.05, 0.05]}),
        ground=ground_map(lambda x, y: 0.1 * np.maximum(x - 15.0, 0.0)),
        free_ground=plane(),
        status=Status.BLOCKED,
        says="is outside the trained -2.9° … 2.9°",
    ),
    "a ridge": Scene(
        "crest",
        tables_with(
            vehicle=STRONG,
            limits=BRISK | {"speed": 6.0, "vertical_accel": 50.0},
            braking={"speed_range": [1.0, 6.0]},
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
    "a turn tighter than the steering": Scene(
        "steering",
        tables_with() | {"steering": {"kind": "skid_steer", "min_radius": 6.0}},
        tables_with() | {"steering": {"kind": "skid_steer", "min_radius": 3.0}},
        ground=ground_map(lambda x, y: 0.0 * x, x=(-5.0, 25.0), y=(-8.0, 14.0)),
        path=turn_after(12.0, 4.0),
        status=Status.BLOCKED,
        says="at least 6.00 m is needed",
    ),
    "a step across the path": Scene(
        "step",
        tables_with(),
        ground=plane_with(lambda x, y: 0.15 * (x > 20.0)),
        free_ground=plane_with(lambda x, y: 0.06 * (x > 20.0)),
        status=Status.BLOCKED,
        says="m up under the front",
    ),
    "a rock between the wheels": Scene(
        "clearance",
        tables_with(vehicle={"front_overhang": 0.0, "wheelbase": 1.25, "cg_x": 0.625}),
        ground=plane_with(lambda x, y: 0.4 * (np.hypot(x - 20.0, y) < 0.2)),
        free_ground=plane_with(lambda x, y: 0.15 * (np.hypot(x - 20.0, y) < 0.2)),
        status=Status.BLOCKED,
        says="m high between the wheels",
    ),
    "a rock before the front overhang": Scene(
        "body",
        tables_with(vehicle={"front_overhang": 0.6}),
        ground=plane_with(lambda x, y: 0.4 * (np.hypot(x - 20.0, y) < 0.2)),
        free_ground=plane_with(lambda x, y: 0.15 * (np.hypot(x - 20.0, y) < 0.2)),
        status=Status.BLOCKED,
        says="m high under the front overhang",
    ),
    "a washboard": Scene(
        "roughness",
        tables_with(),
        ground=plane_with(lambda x, y: 0.04 * np.sin(2.0 * np.pi * x / 1.5)),
        free_ground=plane_with(lambda x, y: 0.04 * np.sin(2.0 * np.pi * x / 15.0)),
        share=0.3,
    ),
}
