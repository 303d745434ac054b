"""The quad as tables of a model file, so that a test can change one number, and as a model."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Braking, Effect, Limits, Model, Terrain
from slopewise.models.steering import Steering
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.models.vehicle import Vehicle

G = 9.80665
Tables = dict[str, Any]

ATV: Tables = {
    "name": "atv",
    "vehicle": {
        "mass": 500.0,
        "wheelbase": 1.2,
        "track_width": 1.0,
        "cg_x": 0.6,
        "cg_z": 0.55,
        "wheel_radius": 0.28,
        "drive": "skid_steer",
        "max_wheel_speed": 6.0,
        "max_drive_force": 2500.0,
        "max_drive_power": 6000.0,
    },
    "braking": {
        "m_m": -0.03,
        "b_m": -0.35,
        "m_b": 0.015,
        "b_b": 0.40,
        "dead_time": 0.30,
        "distance_offset": 0.20,
        "drive_in_dead_time": "held",
        "speed_range": [1.0, 4.0],
        "grade_range": [-0.26, 0.26],
    },
    "terrain": {"motion_resistance": 0.13, "lateral_resistance": 0.20, "slip_track": 1.15},
    "limits": {
        "speed": 4.0,
        "accel": 1.0,
        "decel": 1.5,
        "jerk": 2.0,
        "lateral_accel": 2.0,
        "min_load": 0.10,
    },
}
"""A quad of 500 kg: every limit can be made to hold by changing one number."""

SMALL: dict[str, dict[str, Any]] = {
    "vehicle": {
        "mass": 50.0,
        "wheelbase": 0.5,
        "track_width": 0.45,
        "cg_x": 0.25,
        "cg_z": 0.2,
        "wheel_radius": 0.15,
        "max_wheel_speed": 2.0,
        "max_drive_force": 350.0,
        "max_drive_power": 350.0,
    },
    "braking": {"speed_range": [0.3, 1.5], "dead_time": 0.2, "distance_offset": 0.05},
    "terrain": {"motion_resistance": 0.08, "slip_track": 0.7},
    "limits": {"speed": 1.5},
}
"""What a robot of 50 kg has instead."""


def tables_with(*effects: tuple[str, Mapping[str, float]], **changes: Mapping[str, Any]) -> Tables:
    """The quad with some keys changed, by table, and with effects."""
    tables = copy.deepcopy(ATV)
    for table, values in changes.items():
        tables[table].update(values)
    if effects:
        tables["effect"] = [{"name": name, "parameters": dict(p)} for name, p in effects]
    return tables


def model_of(tables: Mapping[str, Any]) -> Model:
    """The planner's parameters from the tables of a model file."""

    def typed(values: Mapping[str, Any]) -> dict[str, Any]:
        out = {k: tuple(v) if k.endswith("_range") else v for k, v in values.items()}
        return out | ({"uphill": UphillBraking(**out["uphill"])} if "uphill" in out else {})

    braking = dict(tables["braking"])
    surfaces = {n: SurfaceBraking(**typed(v)) for n, v in braking.pop("terrain", {}).items()}
    return Model(
        name=tables["name"],
        vehicle=Vehicle(**tables["vehicle"]),
        braking=Braking(**typed(braking), terrain=surfaces),
        terrain=Terrain(**tables["terrain"]),
        limits=Limits(**tables["limits"]),
        steering=Steering(**tables["steering"]) if "steering" in tables else None,
        tracking=Tracking(**tables["tracking"]) if "tracking" in tables else None,
        effect=tuple(Effect(**effect) for effect in tables.get("effect", ())),
    )


_QUAD = model_of(ATV)
BASE = replace(_QUAD, name="test", braking=replace(_QUAD.braking, drive_in_dead_time="either"))
"""The quad as a model, whose drive may push or not during the dead time."""


def with_effect(name: str, **parameters: float) -> Model:
    """The quad with one effect."""
    return replace(BASE, effect=(Effect(name=name, parameters=parameters),))


def with_braking(**changes: Any) -> Model:
    """The quad with other braking parameters."""
    return replace(BASE, braking=replace(BASE.braking, **changes))
