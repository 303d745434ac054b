"""How much time smoothed plans lose against the optimum, over many generated problems.

Each problem is drawn anew: ground, path, limits, speed and acceleration at the start, and the clear
distance. The planner smooths it as it does for any plan, first from nothing, then from cycle to
cycle while the path is driven; IPOPT solves the same problem with the exact constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.judge import smooth_excess, travel_time
from benchmarks.measure import machine, summary, timed
from benchmarks.one_by_one import one_station_on
from benchmarks.scene import SPACING, atv, hills
from benchmarks.tables import duration
from models.parameters import Model
from planner.bounds import numbers
from planner.candidates import time_optimal_batch
from planner.compiled import Floats
from planner.elevation_map import ElevationMap
from planner.emission import Emission
from planner.reference import JerkLimitedReference
from planner.smoothing import Smoother, SmoothingProblem

INSTANCES, QUICK_INSTANCES = 500, 40
WANTED_EXCESS, WANTED_RATIO = 0.01, 10.0
_STATIONS = (60, 80, 100, 150)
_CYCLES = 3
"""Stations driven on before the warm answer counts."""

_SEED = 11

Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Instance:
    """One generated problem.

    Attributes:
        name: what was drawn, for people.
        problem: jerk-limited, below the time-optimal profile.
    """

    name: str
    problem: SmoothingProblem


def instances(wanted: int, seed: int = _SEED) -> Iterator[Instance]:
    """So many problems of vehicles that move; the same ones for the same seed."""
    rng = np.random.default_rng(seed)
    grounds = [hills(patches) for patches in (0, 12)]
    found = 0
    while found < wanted:
        instance = _draw(rng, grounds)
        if instance is not None:
            found += 1
            yield instance


def run(quick: bool = False, progress: Callable[[int], None] | None = None) -> Result:
    """Solve all of them both ways; the result is plain data, ready for JSON."""
    rows = []
    for instance in instances(total(quick)):
        rows.append(compared(instance))
        if progress is not None:
            progress(1)
    both = [row for row in rows if row["excess"] is not None]
    excess = np.array([row["excess"] for row in both])
    cold, warm, ipopt = ([row[name] for row in rows] for name in ("cold", "warm", "ipopt"))
    driven_on = [row["warm_excess"] for row in rows if row["warm_excess"] is not None]
    return {
        "quick": quick,
        "machine": machine(),
        "instances": len(rows),
        "solved_by_both": len(both),
        "unsolved": [row for row in rows if row["excess"] is None],
        "excess": _distribution(excess),
        "warm_excess": _distribution(np.array(driven_on)),
        "warm_of": len(driven_on),
        "above": [row for row in both if row["excess"] > WANTED_EXCESS],
        "breach": max(row["breach"] for row in both),
        "seconds": {
            "from nothing": summary(cold),
            "from the last cycle": summary([s for s in warm if s is not None]),
            "IPOPT": summary(ipopt),
        },
        "ratio": _ratios(ipopt, cold),
        "warm_ratio": _ratios(
            *zip(*((i, w) for i, w in zip(ipopt, warm, strict=True) if w is not None), strict=True)
        ),
        "wanted": {"excess": WANTED_EXCESS, "ratio": WANTED_RATIO},
    }  # fmt: skip


def total(quick: bool) -> int:
    """Problems that :func:`run` reports to ``progress``."""
    return QUICK_INSTANCES if quick else INSTANCES


def compared(instance: Instance) -> Result:
    """One problem both ways: excess of travel time, and seconds."""
    problem = instance.problem
    n = len(problem.speed_sq_max)
    smoother, reference = Smoother(n), _reference(n)
    cold, answer = _second(partial(smoother.smooth, problem))
    ipopt, optimum = _second(partial(reference.solve, problem))
    row: Result = {
        "name": instance.name, "cold": cold, "ipopt": ipopt, "warm": None, "excess": None,
        "warm_excess": None, "breach": None, "reason": answer.reason or optimum.reason,
    }  # fmt: skip
    if answer.speed_sq is None or optimum.speed_sq is None:
        return row
    row["excess"] = _time(problem, answer.speed_sq) / optimum.travel_time - 1.0
    row["travel_time"] = optimum.travel_time
    row["breach"] = smooth_excess(problem, answer.speed_sq)
    seconds = []
    for _ in range(_CYCLES):
        problem = one_station_on(problem, answer.speed_sq)
        taken, answer = timed(partial(smoother.smooth, problem, 1))
        seconds.append(taken)
        if answer.speed_sq is None or problem.speed_sq_max[0] <= 0.0:
            return row
    optimum = reference.solve(problem)
    if optimum.speed_sq is not None and optimum.travel_time > 0.0:
        row["warm"] = float(np.median(seconds))
        row["warm_excess"] = _time(problem, answer.speed_sq) / optimum.travel_time - 1.0
    return row


def _second(action: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds and result of an action that ran once before, uncounted."""
    action()
    return timed(action)


def _time(problem: SmoothingProblem, speed_sq: Floats) -> float:
    return travel_time(np.concatenate(([0.0], np.cumsum(problem.ds))), speed_sq)


@cache
def _reference(stations: int) -> JerkLimitedReference:
    return JerkLimitedReference(stations)


def _distribution(values: Floats) -> dict[str, float]:
    shares = {"least": 0.0, "median": 50.0, "p90": 90.0, "p99": 99.0, "most": 100.0}
    return {name: float(np.percentile(values, share)) for name, share in shares.items()}


def _ratios(slow: Any, quick: Any) -> dict[str, float]:
    """How many times quicker, problem by problem."""
    ratio = np.asarray(slow) / np.asarray(quick)
    wanted = float(np.mean(ratio >= WANTED_RATIO))
    return {"median": float(np.median(ratio)), "least": float(ratio.min()), "share": wanted}


def _draw(rng: np.random.Generator, grounds: list[ElevationMap]) -> Instance | None:
    """One problem; None where the vehicle does not get away from its start."""
    stations = int(rng.choice(_STATIONS))
    model, ground = _vehicle(rng), grounds[int(rng.integers(len(grounds)))]
    x, y = _path(rng, stations)
    start = float(rng.choice([0.0, rng.uniform(0.0, 2.5)]))
    clear = float(rng.choice([np.inf, rng.uniform(4.0, 20.0)]))
    solved = time_optimal_batch(
        ground, x, y, np.array([stations]), model, start_speed=start, clear=clear
    )
    # A start that is too fast for service braking is not for smoothing.
    if solved.speed_sq[:, 0].max() < 0.25 or solved.reachable_start_sq[0] < start**2:
        return None
    emission = Emission(
        model, numbers(model), solved.profile, solved.ground, solved.bounds, 0,
        np.array([start**2]),
    )  # fmt: skip
    top = np.ascontiguousarray(solved.speed_sq[:, 0])
    accel, decel = emission.segment_limits(top)
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
    limits = replace(
        model.limits,
        speed=rng.uniform(1.5, 4.0), accel=rng.uniform(0.4, 2.0), decel=rng.uniform(0.6, 2.5),
        jerk=rng.uniform(0.8, 6.0), lateral_accel=rng.uniform(0.8, 4.0),
    )  # fmt: skip
    braking = replace(
        model.braking, b_b=rng.uniform(0.3, 0.6), b_m=rng.uniform(-0.5, 0.5),
        dead_time=rng.uniform(0.1, 0.6),
    )  # fmt: skip
    return replace(model, limits=limits, braking=braking)


def _path(rng: np.random.Generator, stations: int) -> tuple[Floats, Floats]:
    """A winding path inside the map, (N, 1) each."""
    s = SPACING * np.arange(stations)
    bend = rng.uniform(-0.08, 0.08) + rng.uniform(0.0, 0.15) * np.sin(
        2.0 * np.pi * s / rng.uniform(6.0, 30.0) + rng.uniform(0.0, 6.3)
    )
    heading = rng.uniform(-np.pi, np.pi) + SPACING * np.cumsum(bend)
    east, north = SPACING * np.cumsum(np.cos(heading)), SPACING * np.cumsum(np.sin(heading))
    x, y = rng.uniform(38.0, 42.0, 2)
    return (x + east)[:, None], (y + north)[:, None]


def show(result: Result, console: Console | None = None) -> None:
    """Print tables, and every problem that misses what is wanted."""
    screen = console or Console()
    table = Table(title="Smoothed plans against the optimum by IPOPT", title_justify="left")
    table.add_column()
    columns = ("from nothing", "from the last cycle")
    for title in columns:
        table.add_column(title, justify="right")
    table.add_row("problems solved by both", f"{result['solved_by_both']}", f"{result['warm_of']}")
    for name in ("least", "median", "p90", "p99", "most"):
        cells = (f"{result[key][name]:.3%}" for key in ("excess", "warm_excess"))
        table.add_row(f"travel time above it, {name}", *cells)
    seconds = result["seconds"]
    table.add_row("time, median", *(duration(seconds[name]["median"]) for name in columns))
    table.add_row("time of IPOPT, median", *[duration(seconds["IPOPT"]["median"])] * 2)
    for name, text in (("median", "{:.1f}×"), ("least", "{:.1f}×"), ("share", "{:.0%}")):
        label = "10 times as fast, share" if name == "share" else f"times as fast, {name}"
        cells = (text.format(result[key][name]) for key in ("ratio", "warm_ratio"))
        table.add_row(label, *cells)
    screen.print(table)
    for row in result["above"]:
        screen.print(f"{row['excess']:.2%} above the optimum: {row['name']}")
    for row in result["unsolved"]:
        screen.print(f"not solved: {row['name']}: {row['reason']}")
