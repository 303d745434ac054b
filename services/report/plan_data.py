"""What the script of a plan page draws: map, plans and limits as JSON holds them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.explain.bound_curves import bound_curves
from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.plan import Obstacle, SpeedPlan
from slopewise.services.report.contours import (
    contour_path,
    interval,
    levels,
    outline_path,
    smoothed,
)
from slopewise.services.report.hillshade import coarsen, shade
from slopewise.services.report.plan_summary import PlanSummary
from slopewise.services.report.png import encode_grey_alpha
from slopewise.services.report.words import word

MOST_CELLS = 900
"""Longest edge of the relief in cells; larger maps are averaged."""

MOST_STATIONS = 40_000
"""Of all plans together on one page; beyond, each is thinned."""

_FEWEST_STATIONS = 24
_MOST_OF_ONE = 4_000
_DECIMALS = {
    "station": 3,
    "z": 3,
    "grade": 4,
    "roll": 4,
    "curvature": 4,
    "speed": 3,
    "accel": 3,
    "time": 2,
    "speed_bound": 3,
    "stop_distance": 3,
    "rear_load": 3,
    "side_load": 3,
}


def relief(
    elevation_map: ElevationMap, most_cells: int = MOST_CELLS
) -> tuple[bytes, dict[str, Any]]:
    """The map as a picture, and where it lies.

    Args:
        most_cells: longest edge of the picture; larger maps are averaged.

    Returns:
        PNG, north on top; and a table with ``bounds`` of the picture and ``origin`` of its lines
        relative to the centre of cell [0, 0] [m], ``cell`` [m], ``contours`` and ``surfaces``.
    """
    heights, factor = coarsen(elevation_map.elevation, most_cells)
    cell = elevation_map.resolution * factor
    rows, columns = heights.shape
    # Centre of the first block, from the centre of the first cell.
    first = 0.5 * (cell - elevation_map.resolution)
    low = first - 0.5 * cell
    step = interval(heights)
    even = smoothed(heights)
    lines = ((float(level), contour_path(even, float(level))) for level in levels(even, step))
    return encode_grey_alpha(shade(heights, cell)), {
        "origin": list(elevation_map.origin),
        "bounds": [low, low + columns * cell, low, low + rows * cell],
        "first": first,
        "cell": cell,
        "interval": step,
        "contours": [
            {"level": round(level, 6), "strong": round(level / step) % 5 == 0, "path": path}
            for level, path in lines
            if path
        ],
        "surfaces": _surfaces(elevation_map, factor),
    }


def _surfaces(elevation_map: ElevationMap, factor: int) -> list[dict[str, str]]:
    """Outlines of the named surfaces that the map tells apart."""
    classes = elevation_map.terrain_class
    if classes is None:
        return []
    classes = classes[::factor, ::factor]
    outlines = (
        (name, outline_path(classes == index))
        for index, name in enumerate(elevation_map.class_names)
        if index > 0
    )
    return [{"name": name, "path": path} for name, path in outlines if path]


def plan_table(
    plan: SpeedPlan,
    summary: PlanSummary,
    origin: tuple[float, float],
    most: int,
    bounds: Mapping[Limiting, Floats],
) -> dict[str, Any]:
    """One plan: its summary and columns, positions relative to the map's origin.

    Args:
        most: stations to keep; those at which something happens are kept first.
        bounds: (N,) what each bound by itself allows [m/s].
    """
    kept = thinned(plan, most)
    columns: dict[str, Any] = {
        name: numbers(getattr(plan, name)[kept], decimals) for name, decimals in _DECIMALS.items()
    }
    columns["x"] = numbers(plan.x[kept] - origin[0], 3)
    columns["y"] = numbers(plan.y[kept] - origin[1], 3)
    columns["limiting"] = [int(code) for code in plan.limiting[kept]]
    clear = plan.clear_distance
    return {
        "name": plan.candidate,
        "status": plan.status.value,
        "reason": plan.reason,
        "rank": summary.rank,
        "stations": len(plan.station),
        "clear": round(clear, 3) if math.isfinite(clear) else None,
        "time": number(summary.travel_time),
        "progress": number(summary.progress),
        "length": number(summary.length),
        "mean": number(summary.mean_speed),
        "max": number(summary.max_speed),
        "margin": number(summary.margin),
        "rear": number(summary.rear_load),
        "side": number(summary.side_load),
        "beside": number(summary.path_deviation),
        "limits": None if summary.limits_most is None else int(summary.limits_most),
        "obstacle": _met(plan.obstacle, origin),
        "columns": columns,
        "bounds": [
            {"code": int(bound), "speed": numbers(speed[kept], 3)}
            for bound, speed in bounds.items()
            if np.isfinite(speed).any()
        ],
    }


def _met(obstacle: Obstacle | None, origin: tuple[float, float]) -> dict[str, Any] | None:
    """What ends the clear distance, if it is something on the ground."""
    if obstacle is None:
        return None
    return {
        "code": int(obstacle.bound),
        "x": number(obstacle.x - origin[0]),
        "y": number(obstacle.y - origin[1]),
        "height": number(obstacle.height),
        "words": obstacle.words,
    }


def thinned(plan: SpeedPlan, most: int) -> Ints:
    """Indices of about ``most`` stations: even ones, where it rests, and extremes in between."""
    count = len(plan.station)
    if count <= most:
        return np.arange(count)
    kept = set(np.linspace(0, count - 1, max(most // 2, 2)).astype(np.int64).tolist())
    moving = np.flatnonzero(plan.speed > 0.0)
    if len(moving):
        kept.add(min(int(moving[-1]) + 1, count - 1))
    edges = np.linspace(0, count, max(most // 8, 2)).astype(np.int64)
    for first, behind in itertools.pairwise(edges.tolist()):
        for values in (plan.speed, np.minimum(plan.rear_load, plan.side_load)):
            part = np.nan_to_num(values[first:behind])
            kept |= {int(first + part.argmin()), int(first + part.argmax())}
    return np.array(sorted(kept), np.int64)


def numbers(values: Floats, decimals: int) -> list[float | None]:
    """Rounded; what is not finite becomes None, as JSON has no word for it."""
    return [v if math.isfinite(v) else None for v in np.round(values, decimals).tolist()]


def number(value: float | None, decimals: int = 3) -> float | None:
    """Rounded, or None if there is none or it is not finite."""
    return round(value, decimals) if value is not None and math.isfinite(value) else None


def page_data(
    elevation_map: ElevationMap,
    plans: Sequence[SpeedPlan],
    summaries: Sequence[PlanSummary],
    model: Model,
    selected: int | None,
) -> tuple[bytes, dict[str, Any]]:
    """The picture of the map, and everything else that the script reads."""
    picture, ground = relief(elevation_map)
    most = max(min(MOST_STATIONS // max(len(plans), 1), _MOST_OF_ONE), _FEWEST_STATIONS)
    origin = elevation_map.origin
    limits = model.limits
    return picture, {
        "map": ground,
        "plans": [
            plan_table(plan, summary, origin, most, bound_curves(elevation_map, plan, model))
            for plan, summary in zip(plans, summaries, strict=True)
        ],
        "selected": selected or 0,
        "limiting": [
            {
                "key": code.label,
                "word": word(code),
                "meaning": bound.meaning,
                "dark": bound.dark_text,
            }
            for code, bound in BOUNDS.items()
        ],
        "limits": {
            "speed": number(limits.speed),
            "accel": number(limits.accel),
            "decel": number(limits.decel),
            "min_load": number(limits.min_load),
            "grade_range": numbers(np.asarray(model.braking.grade_range), 4),
        },
    }
