"""The closed-loop benchmark: every policy drives the same scenes with models learned from stops."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.console import Console

from slopewise.models.parameters import Model

from ..common import campaign
from ..common.campaign import BenchmarkRequest, Progress, Result, ResultCache
from ..common.text_tables import RELATIONS, table_of
from .drive_loop import DrivenScene, dem_folder, run_drive, scene
from .policies import LevelBrakes, MovingHorizon, Planned, Policy
from .quad import LIMITS, learned_model

SLOPEWISE, PERFECT = "slopewise", "perfect knowledge"
COLUMNS = {  # of the table: key and form of the figures of a policy
    "drives": ("drives", "{:.0f}"),
    "finished": ("finished", "{:.0f}"),
    "forced": ("forced_stops", "{:.0f}"),
    "collisions": ("collisions", "{:.0f}"),
    "past clear": ("past_clear", "{:.0f}"),
    "light": ("load_violations", "{:.0f}"),
    "avoidable": ("load_violations_avoidable", "{:.0f}"),
    "m/s": ("mean_speed", "{:.2f}"),
    "covered": ("covered", "{:.2%}"),
    "excess m": ("mean_excess", "{:+.2f}"),
    "worst m": ("worst_excess", "{:+.2f}"),
}

_SOURCES = ("benchmarks/closed_loop", "models", "planner")
_LIBRARIES = ("mujoco", "numpy", "scipy")


FULL, QUICK = (330, 45), (12, 6)  # drives by slopewise and perfect knowledge, by each other [1]


def policies(model: Model, perfect: Model) -> dict[str, Callable[[], Policy]]:
    """Makers of all policies by name; another planner joins by one more line."""
    makers: list[Callable[[], Policy]] = [
        partial(MovingHorizon, model),
        partial(Planned, model),
        # The upper bound: exact model, exact sensors, foresight of all obstacles.
        partial(Planned, perfect, name=PERFECT, exact=True),
        partial(LevelBrakes, model, 2.0),
        partial(LevelBrakes, model, 3.5),
        partial(LevelBrakes, model),
    ]
    return {make().name: make for make in makers}


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Drive all scenes; results in the folder of the request are not computed again."""
    start = time.perf_counter()
    many, few = QUICK if request.quick else FULL
    dem = dem_folder()
    drives: dict[str, list[DrivenScene]] = {}
    for name, make in policies(learned_model("slopewise"), learned_model("perfect")).items():
        count = many if name in (SLOPEWISE, PERFECT) else few
        stored = None if request.out is None else drive_cache(request.out, name)
        work = partial(_drive, make, dem)
        drives[name] = campaign.run_jobs(work, range(count), progress, f"driving: {name}", stored)
    results = {name: summary(of, drives[PERFECT][: len(of)]) for name, of in drives.items()}
    return {
        "ground": "public elevation models and hills" if dem else "generated hills",
        "policies": results,
        "targets": targets(results, SLOPEWISE, PERFECT),
        "stops": [asdict(stop) for drive in drives[SLOPEWISE] for stop in drive.stops],
        "seconds": time.perf_counter() - start,
    }


def _drive(make: Callable[[], Policy], dem: Path | None, number: int) -> DrivenScene:
    return run_drive(*scene(number, dem), make(), number)


def drive_cache(folder: Path, policy: str) -> ResultCache:
    """Cache of the drives of one policy in the folder of the campaign."""
    name = "".join(c if c.isalnum() else "_" for c in policy)
    return ResultCache(folder / "runs" / f"{name}-{_source_digest()}")


@cache
def _source_digest() -> str:
    """Digest of sources, learned models, libraries and elevation models."""
    dem = dem_folder()
    files = sorted(dem.glob("*.tif")) if dem is not None else []
    return campaign.digest_of_sources(
        _SOURCES,
        ("loop_campaign.py",),
        *(repr(learned_model(name)) for name in ("slopewise", "perfect")),
        *(version(name) for name in _LIBRARIES),
        *(f"{file.name} {file.stat().st_size}" for file in files),
    )


def summary(drives: list[DrivenScene], perfect: list[DrivenScene]) -> Result:
    """Figures of one policy, next to drives with perfect knowledge on the same scenes."""
    stops = [stop for drive in drives for stop in drive.stops]
    excess = np.array([s.predicted - s.actual for s in stops])
    light = np.array([drive.min_load_shares.min() < LIMITS.min_load for drive in drives])
    unavoidable = np.array([drive.min_load_shares.min() < LIMITS.min_load for drive in perfect])
    return {
        "drives": len(drives),
        "finished": sum(drive.finished for drive in drives),
        "forced_stops": sum(stop.forced for stop in stops),
        "collisions": sum(drive.collisions for drive in drives),
        "past_clear": sum(drive.past_clear for drive in drives),
        "load_violations": int(light.sum()),
        "load_violations_avoidable": int((light & ~unavoidable).sum()),
        "least_load": float(min(drive.min_load_shares.min() for drive in drives)),
        "mean_speed": sum(d.distance for d in drives) / sum(d.moving_time for d in drives),
        "track_error": float(np.quantile([drive.track_error for drive in drives], 0.95)),
        "covered": float(np.mean(excess >= 0.0)),
        "worst_excess": float(excess.min()),
        "mean_excess": float(np.mean(excess)),
    }


def targets(results: dict[str, Result], policy: str, perfect: str) -> list[Result]:
    """Targets of a policy with the values that it reached."""
    r = results[policy]
    speed_share = r["mean_speed"] / results[perfect]["mean_speed"]
    avoidable = r["load_violations_avoidable"]
    rows: list[tuple[str, str, float, float]] = [
        ("drives", ">=", 300, r["drives"]),
        ("forced stops", ">=", 1000, r["forced_stops"]),
        ("collisions", "<=", 0, r["collisions"]),
        ("stops past the clear distance", "<=", 0, r["past_clear"]),
        ("load violations that perfect knowledge avoids", "<=", 0, avoidable),
        ("mean speed, share of perfect knowledge", ">=", 0.85, speed_share),
        ("stops not longer than predicted, share", ">=", 0.999, r["covered"]),
        ("mean excess of the prediction [m]", "<=", 0.25, r["mean_excess"]),
    ]
    return [
        {"what": what, "relation": relation, "wanted": target, "reached": float(reached)}
        | {"passed": bool(RELATIONS[relation](reached, target))}
        for what, relation, target, reached in rows
    ]


def show(result: Result, console: Console) -> None:
    by_policy = table_of(f"closed loop: {result['ground']}", *COLUMNS, first="policy")
    for name, row in result["policies"].items():
        by_policy.add_row(name, *(form.format(row[key]) for key, form in COLUMNS.values()))
    console.print(by_policy)
    reached = table_of("targets and values reached", "target", "reached", "", first="what")
    for row in result["targets"]:
        sign = {">=": "≥", "<=": "≤"}[row["relation"]]
        mark = "yes" if row["passed"] else "[red]no[/]"
        figures = (f"{sign} {row['wanted']:g}", f"{row['reached']:.4g}")
        reached.add_row(row["what"].replace("[", "\\["), *figures, mark)
    console.print(reached)
