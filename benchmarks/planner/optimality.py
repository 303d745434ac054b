"""Travel time of smoothed plans above the optimum, over many generated problems.

Ground, path, limits, speed and acceleration at the start and clear distance are drawn for each
problem. The planner smooths it as it does for any plan; IPOPT solves the same problem with the
exact constraints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.profile.problems import SmoothingProblem
from slopewise.planner.profile.reference import JerkLimitedReference
from slopewise.planner.profile.smoothing import smooth

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.profile_quality import smooth_excess, stations_of, travel_time
from ..common.scene import SPACING, atv, hills
from ..common.text_tables import duration, table_of
from ..common.timing import machine, summary, timed

INSTANCES, QUICK_INSTANCES = 500, 40  # Problems of a whole and of a quick run [1]
TARGET_EXCESS, TARGET_RATIO = 0.01, 10.0
"""Largest excess of travel time, and smallest ratio of solution times, that are aimed at [1]."""

_STATIONS = (60, 80, 100, 150)  # of a problem
_SEED = 11  # of all problems


class Instance(NamedTuple):
    """A generated problem, jerk-limited, below the time-optimal profile, and its description."""

    name: str
    problem: SmoothingProblem


def instances(count: int, seed: int = _SEED) -> Iterator[Instance]:
    """Yield problems of vehicles that move; a seed determines them."""
    rng = np.random.default_rng(seed)
    grounds = [hills(patches) for patches in (0, 12)]
    while count > 0:
        instance = _draw(rng, grounds)
        if instance is not None:
            count -= 1
            yield instance


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Solve all problems by the planner and by IPOPT."""
    count = QUICK_INSTANCES if request.quick else INSTANCES
    rows = [compare(i) for i in tracked(progress, "optimality", list(instances(count)))]
    solved = [row for row in rows if row["excess"] is not None]
    excess = np.array([row["excess"] for row in solved])
    planner, ipopt = ([row[name] for row in rows] for name in ("planner", "ipopt"))
    return {
        "quick": request.quick,
        "machine": machine(),
        "instances": len(rows),
        "solved_by_both": len(solved),
        "unsolved": [row for row in rows if row["excess"] is None],
        "excess": _distribution(excess),
        "above": [row for row in solved if row["excess"] > TARGET_EXCESS],
        "breach": max(row["breach"] for row in solved),
        "seconds": {"planner": summary(planner), "IPOPT": summary(ipopt)},
        "ratio": _ratios(ipopt, planner),
        "wanted": {"excess": TARGET_EXCESS, "ratio": TARGET_RATIO},
    }


def compare(instance: Instance) -> Result:
    """Excess of travel time and seconds of one problem, solved by both."""
    problem = instance.problem
    by_planner = partial(smooth, problem)
    by_ipopt = partial(_reference(len(problem.speed_sq_max)).solve, problem)
    for warm_up in (by_planner, by_ipopt):
        warm_up()
    planner, smoothed = timed(by_planner)
    ipopt, optimum = timed(by_ipopt)
    row: Result = {"name": instance.name, "planner": planner, "ipopt": ipopt, "excess": None}
    row |= {"breach": None, "reason": smoothed.reason or optimum.reason}
    if smoothed.speed_sq is None or optimum.speed_sq is None:
        return row
    time = travel_time(stations_of(problem), smoothed.speed_sq)
    row["excess"] = time / optimum.travel_time - 1.0
    row["travel_time"] = optimum.travel_time
    row["breach"] = smooth_excess(problem, smoothed.speed_sq)
    return row


@cache
def _reference(stations: int) -> JerkLimitedReference:
    return JerkLimitedReference(stations)


def _distribution(values: Floats) -> dict[str, float]:
    shares = {"least": 0.0, "median": 50.0, "p90": 90.0, "p99": 99.0, "most": 100.0}
    return {name: float(np.percentile(values, share)) for name, share in shares.items()}


def _ratios(slow: Any, quick: Any) -> dict[str, float]:
    """Ratios of solution times, problem by problem."""
    ratio = np.asarray(slow) / np.asarray(quick)
    share = float(np.mean(ratio >= TARGET_RATIO))
    return {"median": float(np.median(ratio)), "least": float(ratio.min()), "share": share}


def _draw(rng: np.random.Generator, grounds: list[ElevationMap]) -> Instance | None:
    """Draw one problem; None where the vehicle cannot leave its start."""
    stations = int(rng.choice(_STATIONS))
    model, ground = _vehicle(rng), grounds[int(rng.integers(len(grounds)))]
    x, y = _path(rng, stations)
    start = float(rng.choice([0.0, rng.uniform(0.0, 2.5)]))
    clear = float(rng.choice([np.inf, rng.uniform(4.0, 20.0)]))
    path = PathBatch.of_stations(("path",), x, y, np.array([stations]))
    solved = time_optimal_batch(ground, path, model, start_speed=start, clear=clear)
    # A start too fast for service braking is braked hard, not smoothed.
    if solved.speed_sq[:, 0].max() < 0.25 or solved.reachable_start_sq[0] < start**2:
        return None
    top = solved.profile_of(0)
    accel, decel = CandidateColumn(solved, 0, solved.start_sq).segment_limits(top)
    before = float(rng.uniform(-0.5 * decel[0], 0.5 * accel[0])) if start > 0.0 else None
    limits = model.limits
    name = (
        f"{stations} stations from ({x[0, 0]:.1f}, {y[0, 0]:.1f}), start {start:.2f} m/s, "
        f"clear {clear:.1f} m, {limits.accel:.2f}/{limits.decel:.2f} m/s², {limits.jerk:.2f} m/s³"
    )
    ds = np.diff(solved.profile.station[:, 0])
    return Instance(name, SmoothingProblem(ds, top, accel, decel, limits.jerk, before))


def _vehicle(rng: np.random.Generator) -> Model:
    model = atv()
    names = ("speed", "accel", "decel", "jerk", "lateral_accel")
    values = rng.uniform((1.5, 0.4, 0.6, 0.8, 0.8), (4.0, 2.0, 2.5, 6.0, 4.0)).tolist()
    limits = replace(model.limits, **dict(zip(names, values, strict=True)))
    b_b, b_m, dead_time = rng.uniform((0.3, -0.5, 0.1), (0.6, 0.5, 0.6)).tolist()
    braking = replace(model.braking, b_b=b_b, b_m=b_m, dead_time=dead_time)
    return replace(model, limits=limits, braking=braking)


def _path(rng: np.random.Generator, stations: int) -> tuple[Floats, Floats]:
    """A winding path inside the map, (N, 1) each."""
    s = SPACING * np.arange(stations)
    mean, swing = rng.uniform(-0.08, 0.08), rng.uniform(0.0, 0.15)
    wave = np.sin(2.0 * np.pi * s / rng.uniform(6.0, 30.0) + rng.uniform(0.0, 6.3))
    curvature = mean + swing * wave
    heading = rng.uniform(-np.pi, np.pi) + SPACING * np.cumsum(curvature)
    east, north = SPACING * np.cumsum(np.cos(heading)), SPACING * np.cumsum(np.sin(heading))
    x, y = rng.uniform(38.0, 42.0, 2)
    return (x + east)[:, None], (y + north)[:, None]


def show(result: Result, console: Console) -> None:
    """Print the table and every problem that misses its target."""
    table = table_of("Smoothed plans against the optimum by IPOPT", "")
    table.add_row("problems solved by both", f"{result['solved_by_both']}")
    for name, value in result["excess"].items():
        table.add_row(f"travel time above it, {name}", f"{value:.3%}")
    for name, seconds in result["seconds"].items():
        table.add_row(f"time of {name}, median", duration(seconds["median"]))
    for name, text in (("median", "{:.1f}×"), ("least", "{:.1f}×"), ("share", "{:.0%}")):
        label = "10 times as fast, share" if name == "share" else f"times as fast, {name}"
        table.add_row(label, text.format(result["ratio"][name]))
    console.print(table)
    for row in result["above"]:
        console.print(f"{row['excess']:.2%} above the optimum: {row['name']}")
    for row in result["unsolved"]:
        console.print(f"not solved: {row['name']}: {row['reason']}")
