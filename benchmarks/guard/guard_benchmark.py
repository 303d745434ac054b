"""Collisions, loads and friction behind the guard, time of a decision, and time lost by it."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.services.io.model_file import read_model, shipped_models

from ..common.campaign import BenchmarkRequest, Progress
from ..common.text_tables import table_of
from ..common.timing import machine
from .guard_scenes import CONTACT, KINDS, GuardedDrive, drive, scenes
from .guarded_plans import drive_twice

COUNTS = {"forest": 1000, "pivot": 500, "swerve": 500, "slope": 500}  # drives of a whole run [1]
PLANS = 40  # paths over open ground of a whole run [1]
_QUICK = 40  # of a quick run there are that many times fewer [1]

Result = dict[str, Any]


def run(request: BenchmarkRequest, progress: Progress, first: int = 0) -> Result:
    """Drive all scenes, the first with this seed."""
    share, kinds = _QUICK if request.quick else 1, {}
    for kind in KINDS:
        drives, advance = [], progress(kind, COUNTS[kind] // share)
        for scene in scenes(kind, COUNTS[kind] // share, first):
            drives.append(drive(scene))
            advance(1)
        kinds[kind] = summary(drives)
    model, plans = read_model(shipped_models()["atv"]), []
    advance = progress("plans", PLANS // share)
    for seed in range(first, first + PLANS // share):
        plans.append(drive_twice(seed, model))
        advance(1)
    lost = sum(p.guarded_seconds for p in plans) / sum(p.seconds for p in plans) - 1.0
    return {
        "machine": machine(),
        "first_seed": first,
        "drives": kinds,
        "plans": {
            "paths": len(plans),
            "commands": sum(p.cycles for p in plans),
            "changed": sum(p.touched for p in plans),
            "time_lost": lost,
        },
    }


def summary(drives: list[GuardedDrive]) -> Result:
    """Figures of the drives of one kind."""
    actions: Counter[str] = sum((Counter(d.actions) for d in drives), Counter())
    seconds = np.concatenate([d.decision_seconds for d in drives])
    return {
        "drives": len(drives),
        "collisions": sum(d.contact > CONTACT for d in drives),
        "touches": sum(0.0 <= d.contact <= CONTACT for d in drives),
        "tipped": sum(d.min_load < 0.0 for d in drives),
        "slid": sum(d.grip > 1.0 for d in drives),
        "min_load": min(d.min_load for d in drives),
        "grip": max(d.grip for d in drives),
        "metres": sum(d.distance for d in drives),
        "turns": sum(d.turned for d in drives) / (2.0 * np.pi),
        "top_speed": max(d.top_speed for d in drives),
        "actions": dict(actions),
        "decision_ms": {str(q): 1e3 * float(np.quantile(seconds, q)) for q in (0.5, 0.99)},
        "faults": [f"{d.scene}: {d.fault}" for d in drives if d.fault],
    }


def show(result: Result, console: Console) -> None:
    """Print the tables."""
    counts = ("drives", "collisions", "touches", "tipped", "slid")
    sizes = ("min_load", "grip", "metres", "turns", "top_speed")
    titles = (*counts, "least load", "grip used", "metres", "turns", "m/s", "pass", "slow", "stop")
    table = table_of("behind the guard", *titles, "ms", "p99 ms", first="kind")
    for kind, row in result["drives"].items():
        shown = [str(row[key]) for key in counts] + [f"{row[key]:.2f}" for key in sizes]
        shown += [str(row["actions"].get(key, 0)) for key in ("pass", "slow", "stop")]
        table.add_row(kind, *shown, *(f"{value:.2f}" for value in row["decision_ms"].values()))
    console.print(table)
    for row in result["drives"].values():
        for fault in row["faults"]:
            console.print(fault)
    plans = result["plans"]
    console.print(
        f"moving horizon on open ground: {100.0 * plans['time_lost']:.1f} % slower, "
        f"{plans['changed']} of {plans['commands']} commands changed on {plans['paths']} paths"
    )
