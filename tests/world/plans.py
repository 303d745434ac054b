"""Plans of one path, verdicts of the checker on them, and stops of the slow reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws.wheel_loads import left_load_share, rear_load_share, right_load_share
from slopewise.models.stops.simulation import GroundTrack, SimulatedStop, simulate_stop
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from slopewise.services.io.plan_file import driven
from tests.world.vehicles import G, model_of


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
        # An infeasible plan is never valid; its columns are still right.
        is_relevant = plan.status is not Status.INFEASIBLE or v.kind == "columns"
        if is_relevant and not wheel and v.size > slack * TOLERANCES[v.kind].value:
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
