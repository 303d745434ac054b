"""Models as tables, ground and paths for the planner's tests, and verdicts of the checker.

Models are the tables of a model file, so that a test can change one number; `model_of` turns them
into the planner's parameters.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws.wheel_loads import left_load_share, rear_load_share, right_load_share
from slopewise.models.parameters import Braking, Effect, Limits, Model, Terrain
from slopewise.models.stops.simulation import GroundTrack, SimulatedStop, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.models.vehicle import Vehicle
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from slopewise.services.io.plan_file import driven

G = 9.80665
ROOT = Path(__file__).parents[2]
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

    def uphill(values: dict[str, Any]) -> dict[str, Any]:
        if "uphill" in values:
            values = values | {"uphill": UphillBraking(**values["uphill"])}
        return values

    def ranges(values: Mapping[str, Any]) -> dict[str, Any]:
        named = ("speed_range", "grade_range", "roll_range")
        return uphill({k: tuple(v) if k in named else v for k, v in values.items()})

    braking = dict(tables["braking"])
    surfaces = {
        name: SurfaceBraking(**ranges(values))
        for name, values in braking.pop("terrain", {}).items()
    }
    return Model(
        name=tables["name"],
        vehicle=Vehicle(**tables["vehicle"]),
        braking=Braking(**ranges(braking), terrain=surfaces),
        terrain=Terrain(**tables["terrain"]),
        limits=Limits(**tables["limits"]),
        effect=tuple(Effect(**effect) for effect in tables.get("effect", ())),
    )


def data_folder() -> Path:
    """Where the public recordings are, if they are."""
    return Path(os.environ.get("SLOPEWISE_DATA", ROOT.parent / "shared" / "data"))


# ---------------------------------------------------------------------------------- ground


def ground_map(
    height: Callable[[np.ndarray, np.ndarray], Any],
    *,
    x: tuple[float, float] = (-3.0, 45.0),
    y: tuple[float, float] = (-6.0, 6.0),
    resolution: float = 0.25,
    unknown: Callable[[np.ndarray, np.ndarray], Any] | None = None,
    classes: Callable[[np.ndarray, np.ndarray], Any] | None = None,
    class_names: tuple[str, ...] = ("",),
) -> ElevationMap:
    """A map from functions of x and y [m]."""
    columns = round((x[1] - x[0]) / resolution) + 1
    rows = round((y[1] - y[0]) / resolution) + 1
    east, north = np.meshgrid(
        x[0] + resolution * np.arange(columns), y[0] + resolution * np.arange(rows)
    )
    elevation = np.broadcast_to(np.asarray(height(east, north), float), east.shape).copy()
    if unknown is not None:
        elevation[np.asarray(unknown(east, north), bool)] = np.nan
    return ElevationMap(
        elevation=elevation,
        resolution=resolution,
        origin=(x[0], y[0]),
        terrain_class=None if classes is None else np.asarray(classes(east, north), np.int64),
        class_names=class_names,
    )


def plane(rise: float = 0.0, cross: float = 0.0, **options: Any) -> ElevationMap:
    """z = rise x + cross y."""
    return ground_map(lambda x, y: rise * x + cross * y, **options)


# ----------------------------------------------------------------------------------- paths


def straight(length: float, heading: float = 0.0, **options: Any) -> CandidatePath:
    """From the origin."""
    along = np.array([0.0, length])
    return CandidatePath(
        options.pop("name", "straight"),
        np.stack([along * np.cos(heading), along * np.sin(heading)], axis=1),
        **options,
    )


def arc(length: float, curvature: float, heading: float = 0.0, **options: Any) -> CandidatePath:
    """A circle from the origin, left turns positive."""
    along = np.linspace(0.0, length, max(int(length / 0.1), 20))
    yaw = heading + curvature * along
    x = (np.sin(yaw) - np.sin(heading)) / curvature
    y = (np.cos(heading) - np.cos(yaw)) / curvature
    return CandidatePath(options.pop("name", "arc"), np.stack([x, y], axis=1), **options)


# ------------------------------------------------------------------------------------ plans


def plan_one(
    tables: Mapping[str, Any],
    elevation_map: ElevationMap,
    path: CandidatePath,
    settings: PlannerSettings | None = None,
    **options: Any,
) -> SpeedPlan:
    """One plan from a new planner."""
    (plan,) = CandidatePlanner(model_of(tables), settings).plan(elevation_map, [path], **options)
    return plan


def violations(
    plan: SpeedPlan,
    tables: Mapping[str, Any],
    ground: ElevationMap,
    *,
    clear: float = np.inf,
    jerk: bool | None = None,
    slack: float = 1.0,
) -> dict[str, list[str]]:
    """Sentences against a plan by kind, from the checker; about jerk as well where it is smoothed.

    `slack` multiplies the tolerances of the checker: 2 on generated ground, whose slopes change
    between rows by more than those of a real map.
    """
    if jerk is None:
        smoothed = plan.status in (Status.OK, Status.BLOCKED)
        jerk = smoothed and int(Limiting.JERK) in plan.limiting
    model = model_of(tables)
    out: dict[str, list[str]] = {}
    for v in check_plan_on_map(
        plan_of_columns(driven(plan)), model, ground, clear=clear
    ).violations:
        # Under drive the front axle is bounded, and each side; a wheel that is on both is not.
        wheel = v.sentence.startswith("the lightest wheel")
        if not wheel and v.size > slack * TOLERANCES[v.kind].value:
            out.setdefault(v.kind, []).append(f"{v.station:.3f} m, {v.kind}: {v.sentence}")
    if jerk and (steps := _jerk_above(plan, 1.01 * model.limits.jerk + 1e-6)):
        out["jerk"] = steps
    return out


def _jerk_above(plan: SpeedPlan, limit: float) -> list[str]:
    """Steps of the acceleration between segments, over the time from middle to middle."""
    accel, time, speed = plan.accel, plan.time, plan.speed
    span = 0.5 * (time[2:] - time[:-2])
    moving = (speed[1:-1] > 0.0) & (speed[1:-1] + speed[2:] > 0.0) & (span > 0.0)
    step = np.abs(np.diff(accel[:-1])) - limit * span
    return [
        f"{plan.station[k + 1]:.3f} m, jerk" for k in np.flatnonzero(moving & (step > 0.0)).tolist()
    ]


def assert_sound(
    plan: SpeedPlan, tables: Mapping[str, Any], ground: ElevationMap, **options: Any
) -> None:
    """No violation."""
    sentences = [
        text for kind in violations(plan, tables, ground, **options).values() for text in kind
    ]
    assert not sentences, "\n".join([f"{plan.status.value} {plan.reason}", *sentences[:10]])


def track_under(plan: SpeedPlan) -> GroundTrack:
    """The ground that a plan reports, for stops of the slow reference."""
    x, y = plan.x, plan.y
    flat = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    yaw = np.unwrap(np.arctan2(*(np.gradient(part, flat, edge_order=2) for part in (y, x))))
    return GroundTrack(plan.station, plan.grade, plan.roll, yaw, plan.curvature, x, y)


def stop_on(
    plan: SpeedPlan, tables: Mapping[str, Any], station: float, speed: float
) -> SimulatedStop:
    """An emergency stop of the slow reference on the ground under a plan."""
    return simulate_stop(model_of(tables), track_under(plan), float(speed), station=float(station))


def min_loads(
    plan: SpeedPlan, tables: Mapping[str, Any], stop: SimulatedStop
) -> tuple[float, float]:
    """Lowest shares of the level static load, of the rear axle and of a side, along a stop."""
    v = model_of(tables).vehicle
    grade, roll, curvature = (
        np.interp(stop.station, plan.station, values)
        for values in (plan.grade, plan.roll, plan.curvature)
    )
    decel = np.concatenate(([0.0], -np.gradient(stop.speed[1:], stop.time[1:])))
    lateral = stop.speed**2 * curvature / np.cos(roll)
    rear = rear_load_share(grade, roll, decel, v.wheelbase, v.cg_x, v.cg_z)
    sides = (left_load_share, right_load_share)
    side = np.minimum(*(share(grade, roll, lateral, v.track_width, v.cg_z) for share in sides))
    track = track_under(plan)
    fall = np.array([-track.vertical_curvature(s) for s in stop.station])
    lost = stop.speed**2 * np.maximum(fall, 0.0) / G
    return float(np.min(rear - lost)), float(np.min(side - lost))


def labels(plan: SpeedPlan) -> list[str]:
    """Label of the limiting bound at each station."""
    return [Limiting(int(code)).label for code in plan.limiting]


def at(plan: SpeedPlan, station: float, values: np.ndarray | Sequence[float]) -> float:
    """A column of a plan at a station."""
    return float(np.interp(station, plan.station, np.asarray(values)))
