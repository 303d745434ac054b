"""Collisions, loads and friction behind the guard, time of a decision, and time lost by it."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
from rich.console import Console

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.services.guard.decide import guard_decision

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import shipped
from ..common.text_tables import table_of
from ..common.timing import machine
from .guard_scenes import CONTACT, KINDS, GuardedDrive, drive, scenes

COUNTS = {"forest": 1000, "pivot": 500, "swerve": 500, "slope": 500}  # drives of a whole run [1]
PLANS = 40  # paths over open ground of a whole run [1]
_QUICK = 40  # of a quick run there are that many times fewer [1]

_CYCLE = 0.1  # [s]
_EDGE, _CELL = 30.0, 0.2  # of the map [m]
_AGE = 0.12  # of pose and speed, with the transport to the base [s]
_SPACING = 0.25  # of the points of a path [m]
_MAX_CYCLES = 400  # of a drive [1]


def run(request: BenchmarkRequest, progress: Progress, first: int = 0) -> Result:
    """Drive all scenes, the first with this seed."""
    share, kinds = _QUICK if request.quick else 1, {}
    for kind in KINDS:
        drives = tracked(progress, kind, scenes(kind, COUNTS[kind] // share, first))
        kinds[kind] = summary([drive(scene) for scene in drives])
    seeds = range(first, first + PLANS // share)
    plans = [drive_twice(seed, shipped("atv")) for seed in tracked(progress, "plans", seeds)]
    seconds, guarded, changed, commands = (sum(part) for part in zip(*plans, strict=True))
    lost = {"paths": len(plans), "commands": commands, "changed": changed}
    lost["time_lost"] = guarded / seconds - 1.0
    return {"machine": machine(), "first_seed": first, "drives": kinds, "plans": lost}


def summary(drives: list[GuardedDrive]) -> Result:
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


def open_ground(rng: np.random.Generator) -> ElevationMap:
    """Rolling ground without obstacles."""
    north, east = _CELL * np.indices(2 * (round(_EDGE / _CELL) + 1,))
    z = np.zeros_like(east)
    for _ in range(5):
        kx, ky, phase = *rng.uniform(-0.3, 0.3, 2), rng.uniform(0.0, 7.0)
        z += rng.uniform(0.05, 0.3) * np.sin(kx * east + ky * north + phase)
    return ElevationMap(elevation=z, resolution=_CELL, origin=(0.0, 0.0))


def curved_path(rng: np.random.Generator) -> CandidatePath:
    """Path across the map with turns of at least 4 m radius."""
    station = np.arange(0.0, 22.0, _SPACING)
    curvature = rng.uniform(-0.25, 0.25) * np.sin(2.0 * np.pi * station / rng.uniform(8.0, 25.0))
    heading = np.cumsum(curvature) * _SPACING
    x, y = np.cumsum(np.cos(heading)) * _SPACING, np.cumsum(np.sin(heading)) * _SPACING
    return CandidatePath("path", np.stack((4.0 + x, 0.5 * _EDGE + y - 0.5 * y[-1]), axis=1))


def _driven(
    model: Model, ground: ElevationMap, path: CandidatePath, *, guarded: bool
) -> tuple[float, int, int]:
    """Time to the last metres of a path [s], commands that were changed, and cycles."""
    horizon = Horizon(model)
    px, py = path.points.T
    station = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(px), np.diff(py)))))
    heading = np.unwrap(np.arctan2(np.gradient(py), np.gradient(px)))
    s, v, touched, last = 0.5, 0.0, 0, (0.0, 0.0)
    for cycle in range(_MAX_CYCLES):
        x, y, yaw = (float(np.interp(s, station, of)) for of in (px, py, heading))
        state = PlanarState(x=x, y=y, heading=yaw, speed=v)
        if s > station[-1] - 5.0:
            return cycle * _CYCLE, touched, cycle
        speed = horizon.step(state, [path], ground).command.speed
        if guarded:
            ahead = max(v, 1.0) * _CYCLE
            before, after = (float(np.interp(s + d, station, heading)) for d in (0.0, ahead))
            command = (speed, (after - before) / ahead * max(v, speed))
            given = (model, ground, (x, y, yaw), v, command)
            decision = guard_decision(*given, age=_AGE, before=(last,))
            last = decision.command.speed, decision.command.yaw_rate
            if decision.action != "pass":
                touched += 1
                speed = decision.command.speed
                if decision.brake:
                    speed = max(v - 0.4, 0.0)
        s += 0.5 * (v + speed) * _CYCLE
        v = speed
    return math.inf, touched, _MAX_CYCLES


def drive_twice(seed: int, model: Model) -> tuple[float, float, int, int]:
    """Times of one path without and with the guard [s], commands that it changed, and all."""
    rng = np.random.default_rng((19, seed))
    ground, path = open_ground(rng), curved_path(rng)
    seconds, *_ = _driven(model, ground, path, guarded=False)
    return seconds, *_driven(model, ground, path, guarded=True)
