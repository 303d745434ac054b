"""Collisions behind the guard, time of a decision, and time lost on open ground."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.services.io.model_file import read_model, shipped_models

from ..common.campaign import BenchmarkRequest, Progress
from ..common.text_tables import table_of
from ..common.timing import machine
from .guard_scenes import CONTACT, KINDS, STAMPS, GuardedDrive, GuardScene, drive
from .guarded_plans import drive_twice

COUNTS = {"forest": 1000, "pivot": 500, "swerve": 500}  # drives of a whole run [1]
PLANS = 40  # paths over open ground of a whole run [1]
_QUICK = 20  # of a quick run there are that many times fewer [1]

Result = dict[str, Any]


def scenes(kind: str, count: int) -> list[GuardScene]:
    """Both drives, both cell sizes; half of the scenes with late, set or repeated stamps."""
    return [
        GuardScene(
            seed,
            kind,
            STAMPS[seed // 2 % len(STAMPS)] if seed % 2 else "prompt",
            "ackermann" if seed % 3 == 2 and kind != "pivot" else "skid_steer",
            0.2 if seed % 4 == 3 else 0.1,
        )
        for seed in range(count)
    ]


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Drive all scenes."""
    model = read_model(shipped_models()["atv"])
    share = _QUICK if request.quick else 1
    kinds = {}
    for kind in KINDS:
        drives, advance = [], progress(kind, COUNTS[kind] // share)
        for scene in scenes(kind, COUNTS[kind] // share):
            drives.append(drive(scene, model))
            advance(1)
        kinds[kind] = summary(drives)
    advance = progress("plans", PLANS // share)
    plans = []
    for seed in range(PLANS // share):
        plans.append(drive_twice(seed, model))
        advance(1)
    lost = sum(p.guarded_seconds for p in plans) / sum(p.seconds for p in plans) - 1.0
    return {
        "machine": machine(),
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
        "metres": sum(d.distance for d in drives),
        "turns": sum(d.turned for d in drives) / (2.0 * np.pi),
        "top_speed": max(d.top_speed for d in drives),
        "actions": dict(actions),
        "decision_ms": {str(q): 1e3 * float(np.quantile(seconds, q)) for q in (0.5, 0.99)},
    }


def show(result: Result, console: Console) -> None:
    """Print the tables."""
    titles = ("drives", "collisions", "touches", "metres", "turns", "m/s", "pass", "slow", "stop")
    table = table_of("behind the guard", *titles, "ms", "p99 ms", first="kind")
    for kind, row in result["drives"].items():
        shown = [str(row[key]) for key in titles[:3]]
        shown += [f"{row[key]:.1f}" for key in ("metres", "turns", "top_speed")]
        shown += [str(row["actions"].get(key, 0)) for key in titles[6:]]
        table.add_row(kind, *shown, *(f"{value:.2f}" for value in row["decision_ms"].values()))
    console.print(table)
    plans = result["plans"]
    console.print(
        f"moving horizon on open ground: {100.0 * plans['time_lost']:.1f} % slower, "
        f"{plans['changed']} of {plans['commands']} commands changed on {plans['paths']} paths"
    )
