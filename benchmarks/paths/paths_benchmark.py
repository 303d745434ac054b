"""Given paths of ten kinds: planned or refused, reported deviations, limits of followers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from rich.console import Console

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.ground.uncertainty import QUANTILE, Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import shipped
from ..common.text_tables import print_rows
from ..common.timing import machine
from .followers import Drive, Passed, follow_exactly, pass_obstacle, pursue
from .given_lines import KINDS, GivenLine, given_line, largest_distance

VEHICLES = {"atv": 1.3, "ugv": 3.6, "husky": 0.8}
"""Vehicles, and the least radius of curves that are given to them [m]."""

ANGULAR = ("grid, 4", "grid, 8", "tree")
"""Kinds whose corners only vehicles drive that turn on the spot."""

COUNT, _QUICK = 120, 12  # paths of a kind in a whole and in a quick run [1]
_CELLS = (0.1, 0.5)  # [m] of the maps
_SLOPES = (0.0, 2.0, 4.0)  # [°] of the planes
_END = 1.0  # [m] from the end of a path where a plan that reaches it stops: its safety offset
_EXACT = 2e-3  # [m] by which a measured deviation may exceed the reported one


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a given path; the drives are None where it was not planned."""

    refused: str = ""
    reached: bool = False
    speed: float = 0.0
    deviation: float = 0.0
    untold: bool = False
    exact: Drive | None = None
    pursuit: Drive | None = None
    obstacle: Passed | None = None


def outcome(kind: str, seed: int) -> Outcome:
    """Plan a path, measure how far the plan leads from it, and drive it twice."""
    vehicle = list(VEHICLES)[seed % len(VEHICLES)]
    if vehicle == "ugv" and kind in ANGULAR:
        vehicle = "atv"
    model, line = shipped(vehicle), given_line(kind, seed, VEHICLES[vehicle])
    rng = np.random.default_rng(seed)
    angle, steep = rng.uniform(-np.pi, np.pi), math.tan(math.radians(_SLOPES[seed // 3 % 3]))
    slope = steep * np.array([math.cos(angle), math.sin(angle)])
    ground = plane(float(slope[0]), float(slope[1]), _CELLS[seed // 9 % 2], line.points)
    try:
        plan = planner(vehicle).plan(ground, [CandidatePath("given", line.points)])[0]
    except ParameterError as error:
        return Outcome(refused=str(error))
    deviation = plan.path_deviation
    assert deviation is not None
    given = up_to_cusp(line)
    reported = deviation.largest if plan.status.value == "ok" else deviation.limit
    far = largest_distance(given, np.stack((plan.x, plan.y), axis=1))
    steers, flat = kind != "noisy", plane(0.0, 0.0, _CELLS[0], line.points)
    exact = follow_exactly(given, plan, model, slope, steers_at_noise=steers)
    pursuit, near = pursue(given, plan, model, slope, rng), np.random.default_rng([seed, 1])
    return Outcome(
        reached=reaches_end(plan, given),
        speed=plan.progress / max(plan.travel_time, 1e-9),
        deviation=deviation.largest,
        untold=far > reported + _EXACT or deviation.largest > deviation.limit,
        exact=exact,
        pursuit=pursuit,
        obstacle=pass_obstacle(given, planner(vehicle), flat, near, steers_at_noise=steers),
    )


def up_to_cusp(line: GivenLine) -> Floats:
    """Points of a path up to where it first turns round, all of them where it does not."""
    if line.cusp is None:
        return line.points
    end = int(np.argmin(np.hypot(*(line.points - line.cusp).T)))
    return line.points[: end + 1]


def reaches_end(plan: SpeedPlan, given: Floats) -> bool:
    """Return True if the plan comes to rest at the end of the given line."""
    x, y = (np.interp(plan.progress, plan.station, axis) for axis in (plan.x, plan.y))
    return bool(np.hypot(*(given[-1] - (x, y))) < _END)


@cache
def planner(name: str) -> CandidatePlanner:
    """Of a vehicle, with the usual caution."""
    return CandidatePlanner(shipped(name), uncertainty=Uncertainty(quantile=QUANTILE))


def plane(slope_x: float, slope_y: float, cell: float, points: Floats) -> ElevationMap:
    """Even ground around points, inclined."""
    low, high = points.min(axis=0) - 4.0, points.max(axis=0) + 4.0
    y, x = np.mgrid[low[1] : high[1] : cell, low[0] : high[0] : cell]
    heights = slope_x * x + slope_y * y
    return ElevationMap(elevation=heights, resolution=cell, origin=(float(low[0]), float(low[1])))


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    count = _QUICK if request.quick else COUNT
    rows = []
    for kind in KINDS:
        seeds = tracked(progress, kind, range(count))
        rows.append(summary(kind, [outcome(kind, seed) for seed in seeds]))
    return {"quick": request.quick, "machine": machine(), "kinds": rows}


def summary(kind: str, outcomes: list[Outcome]) -> Result:
    """Figures of a kind; the worst share of a limit is of all planned paths."""
    planned = [o for o in outcomes if not o.refused]
    drives = {"exact": [o.exact for o in planned], "pursuit": [o.pursuit for o in planned]}
    row: Result = {
        "kind": kind,
        "paths": len(outcomes),
        "planned": sum(o.reached for o in planned),
        "refused": len(outcomes) - len(planned),
        "untold": sum(o.untold for o in planned),
        "mean speed [m/s]": round(float(np.mean([o.speed for o in planned] or [0.0])), 3),
        "largest deviation [m]": round(max((o.deviation for o in planned), default=0.0), 3),
    }
    for name, driven in drives.items():
        done = [drive for drive in driven if drive is not None]
        row[f"{name}: beyond"] = sum(drive.beyond(counts_lateral=name == "exact") for drive in done)
        for limit in ("lateral", "rollover", "friction", "stopping"):
            worst = max((getattr(drive, limit) for drive in done), default=0.0)
            row[f"{name}: {limit}"] = round(worst, 3)
    passed = [o.obstacle for o in planned if o.obstacle is not None]
    row["obstacles passed"] = len(passed)
    row["touched"] = sum(p.touched for p in passed)
    row["free distance [m]"] = round(float(np.mean([p.gap for p in passed] or [0.0])), 3)
    return row


def show(result: Result, console: Console) -> None:
    print_rows(console, "given paths", result["kinds"])
