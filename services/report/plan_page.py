"""The page of `slopewise plan`: map, candidates, and what limits each of them where.

Map and charts are drawn by the script of the page; verdict and table of candidates are plain HTML.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.explain.bound_curves import bound_curves
from slopewise.planner.explain.explain import Explanation
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.plan import Obstacle, SpeedPlan, Status
from slopewise.services.jobs.plan import PlanResult
from slopewise.services.report.page import write_page
from slopewise.services.report.plan_labels import STATUS_MEANING, limit_colours
from slopewise.services.report.plan_numbers import best_plan, numbers_of, verdict
from slopewise.services.report.relief import relief

_PARTS = "page painter charts plan_state plan_map plan_charts plan_details"
SCRIPTS = ("uPlot.iife.min.js", *(f"{part}.js" for part in _PARTS.split()))
STYLES = ("uPlot.min.css", "page.css", "colours.css", "plan.css")

_MAX_STATIONS, _MAX_PLAN_STATIONS, _MIN_PLAN_STATIONS = 40_000, 4_000, 24
"""Stations of all plans on one page, and of one plan; beyond, plans are thinned [1]."""
_DECIMALS = {
    "curvature": 4,
    **dict.fromkeys(("grade", "roll", "speed"), 3),
    **dict.fromkeys(("accel", "rear_load", "side_load", "speed_bound", "station"), 2),
    **dict.fromkeys(("stop_distance", "time", "x", "y", "z"), 2),
}
"""Decimals of each column [1]: half a pixel of a chart. The page holds integers of the last one."""
_NUMBERS = (
    *("travel_time", "progress", "length", "mean_speed", "max_speed", "margin"),
    *("rear_load", "side_load", "path_deviation"),
)
"""Numbers of :func:`.numbers_of` that the script shows."""


def write_job_page(
    path: Path,
    result: PlanResult,
    map_file: Path,
    path_file: Path,
    model: str,
    speed: float,
    clear: float,
) -> None:
    """Write the page of a planning job, all or nothing, with its files, start speed and options."""
    spacing = result.settings.spacing_on(result.elevation_map.resolution, result.model.vehicle)
    facts = {
        "map": str(map_file),
        "paths": str(path_file),
        "model": f"{result.model.name} ({model})",
        "start speed": f"{speed:g} m/s",
        "path known to be free": "to its end" if math.isinf(clear) else f"{clear:g} m",
        "margins cover": _covered(result),
        "stations every": f"{spacing:g} m",
        "planned in": f"{result.seconds:.2f} s",
        "date": time.strftime("%Y-%m-%d %H:%M"),
    }
    write_plan_page(path, result, f"{path_file.stem} on {map_file.stem}", facts)


def _covered(result: PlanResult) -> str:
    if result.uncertainty is None:
        return "the model's mean"
    share = f"{100.0 * result.uncertainty.quantile:g} % of the model's uncertainty"
    return share if result.states_uncertainty else f"{share}, which it does not state"


def write_plan_page(
    path: Path, result: PlanResult, title: str, provenance: Mapping[str, str]
) -> None:
    """Write the page of some plans, best first, all or nothing; provenance: name -> value."""
    plans = result.plans
    numbers = [numbers_of(plan, rank) for rank, plan in enumerate(plans, start=1)]
    best = best_plan(plans)
    picture, ground = relief(result.elevation_map)
    values = {
        "title": title,
        "verdict": verdict(plans),
        "best": None if best is None else numbers[best],
        "best_way": "" if best is None else _format_drive(numbers[best]),
        "provenance": provenance,
        "model": _model_facts(result.model),
        "model_name": result.model.name,
        "relief": picture,
        "numbers": numbers,
        "statuses": list(Status),
        "status_meaning": STATUS_MEANING,
        "bounds": BOUNDS,
        "explanation": result.explanation,
        "costs": _costs(result.explanation),
    }
    write_page(
        path,
        "plan.html",
        values,
        "plan",
        STYLES,
        extra_style=limit_colours(),
        scripts=SCRIPTS,
        data=_page_data(ground, result, numbers),
    )


def _format_drive(n: Mapping[str, Any]) -> str:
    """How far, how long and how fast a plan drives."""
    distance = f"{n['progress']:.1f} m"
    if n["plan"].status is not Status.OK and n["progress"] < n["length"] - 0.05:
        distance += f" of {n['length']:.1f} m"
    time = "" if n["travel_time"] is None else f" in {n['travel_time']:.1f} s"
    top = "" if n["max_speed"] is None else f", at most {n['max_speed']:.2f} m/s"
    return f"{distance}{time}{top}."


def _model_facts(model: Model) -> dict[str, str]:
    vehicle, braking, limits = model.vehicle, model.braking, model.limits
    low, high = np.rad2deg(braking.grade_range)
    slow, fast = braking.speed_range
    facts = {
        "vehicle": f"{vehicle.mass:g} kg, {vehicle.drive.replace('_', '-')}, wheelbase "
        f"{vehicle.wheelbase:g} m, track {vehicle.track_width:g} m, "
        f"centre of gravity {vehicle.cg_z:g} m high",
        "braking on level ground": f"{braking.level_force(fast) * braking.share_at():.0%} of the "
        f"weight after a dead time of {braking.dead_time:g} s",
        "trained for": f"{slow:g} … {fast:g} m/s, grades of {low:.1f}° … {high:.1f}°",
        "limits": f"{limits.speed:g} m/s, +{limits.accel:g} and −{limits.decel:g} m/s², "
        f"{limits.jerk:g} m/s³, {limits.lateral_accel:g} m/s² sideways, "
        f"{limits.min_load:.0%} of the static load on every axle and side, "
        f"{model.max_path_deviation:.3g} m from the given path",
    }
    if model.effect:
        facts["effects"] = ", ".join(effect.name for effect in model.effect)
    return facts


def _costs(explanation: Explanation | None) -> list[tuple[Limiting, float, float, float]]:
    """Bounds that cost time: how long each limits [s], gain [s] and reach [m] without it."""
    if explanation is None:
        return []
    limited = {cost.limiting: 0.0 for cost in explanation.costs}
    for stretch in explanation.stretches:
        limited[stretch.limiting] += stretch.seconds
    return [
        (cost.limiting, limited[cost.limiting], cost.seconds, cost.reach)
        for cost in explanation.costs
        if cost.seconds > 0.0 or limited[cost.limiting] > 0.0
    ]


def _page_data(
    ground: dict[str, Any], result: PlanResult, numbers: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Everything that the script reads."""
    plans, model = result.plans, result.model
    share = _MAX_STATIONS // max(len(plans), 1)
    max_stations = max(min(share, _MAX_PLAN_STATIONS), _MIN_PLAN_STATIONS)
    limits = model.limits
    return {
        "map": ground,
        "plans": [_plan_table(n, result.elevation_map, model, max_stations) for n in numbers],
        "selected": best_plan(plans) or 0,
        "limiting": [
            {
                "key": code.label,
                "word": code.label.replace("_", " "),
                "meaning": b.meaning,
                "dark": b.dark_text,
            }
            for code, b in BOUNDS.items()
        ],
        "limits": {
            **{n: _number(getattr(limits, n)) for n in ("speed", "accel", "decel", "min_load")},
            "grade_range": [_number(grade, 4) for grade in model.braking.grade_range],
        },
        "decimals": _DECIMALS,
    }


def _plan_table(
    n: Mapping[str, Any], ground: ElevationMap, model: Model, max_stations: int
) -> dict[str, Any]:
    """One plan: its numbers and columns, positions relative to the map's origin."""
    plan = n["plan"]
    at = thinned(plan, max_stations)
    x0, y0 = ground.origin
    placed = replace(plan, x=plan.x - x0, y=plan.y - y0)
    bounds = bound_curves(ground, plan, model)
    # The chart of speeds ends there: bounds that are above it everywhere are not shown.
    end = 1.06 * max(1.15 * model.limits.speed, float(plan.speed.max()))
    return {
        "name": plan.candidate,
        "status": plan.status.value,
        "reason": plan.reason,
        "rank": n["rank"],
        "stations": len(plan.station),
        "clear": _number(plan.clear_distance),
        **{name: _number(n[name]) for name in _NUMBERS},
        "limits": None if n["longest_limit"] is None else int(n["longest_limit"]),
        "obstacle": _obstacle(plan.obstacle, ground.origin),
        "columns": {
            **{name: _scaled(getattr(placed, name)[at], name) for name in _DECIMALS},
            "limiting": plan.limiting[at].tolist(),
        },
        "bounds": [
            {"code": int(bound), "speed": _scaled(_capped(speed[at], 2.0 * end), "speed_bound")}
            for bound, speed in bounds.items()
            if (speed < end).any()
        ],
    }


def _capped(values: Floats, highest: float) -> Floats:
    return np.where(np.isfinite(values), np.minimum(values, highest), values)


def _obstacle(obstacle: Obstacle | None, origin: tuple[float, float]) -> dict[str, Any] | None:
    """Obstacle that ends the clear distance, if it is one on the ground."""
    if obstacle is None:
        return None
    return {
        "code": int(obstacle.bound),
        "x": _number(obstacle.x - origin[0]),
        "y": _number(obstacle.y - origin[1]),
        "height": _number(obstacle.height),
        "words": obstacle.words,
    }


def thinned(plan: SpeedPlan, max_stations: int) -> Ints:
    """Indices of about ``max_stations``: evenly, where it comes to rest, and extremes between."""
    count = len(plan.station)
    if count <= max_stations:
        return np.arange(count)
    indices = set(np.linspace(0, count - 1, max(max_stations // 2, 2)).astype(np.int64).tolist())
    moving = np.flatnonzero(plan.speed > 0.0)
    if len(moving):
        indices.add(min(int(moving[-1]) + 1, count - 1))
    edges = np.linspace(0, count, max(max_stations // 8, 2)).astype(np.int64)
    for first, behind in itertools.pairwise(edges.tolist()):
        for values in (plan.speed, np.minimum(plan.rear_load, plan.side_load)):
            part = np.nan_to_num(values[first:behind])
            indices |= {int(first + part.argmin()), int(first + part.argmax())}
    return np.array(sorted(indices), np.int64)


def _scaled(values: Floats, column: str) -> list[int | None]:
    """Whole numbers of the last decimal; None where one is not finite, unknown to JSON."""
    scaled = np.round(values * 10.0 ** _DECIMALS[column])
    return [int(v) if math.isfinite(v) else None for v in scaled.tolist()]


def _number(value: float | None, decimals: int = 3) -> float | None:
    return round(value, decimals) if value is not None and math.isfinite(value) else None
