"""Vehicles drawn at random in four worlds: which effects are named, and which are false."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from rich.console import Console
from rich.table import Table

from ..common.campaign import BenchmarkRequest, Progress, run_jobs
from ..common.text_tables import table_of
from .blind_run import SealedLog, investigate_log
from .world_logs import WorldLog

Result = dict[str, Any]

WORLDS = {"plant": None, "car": "vehiclemodels", "engine": "mujoco", "rocking": "numba"}
"""Worlds, and the package that each needs."""


@dataclass(frozen=True, slots=True)
class Request:
    """One log: its world, and what is drawn."""

    world: str
    kind: str
    label: str
    names: tuple[str, ...]
    seed: int


@dataclass(frozen=True, slots=True)
class Scored:
    """One answer next to the truth.

    Attributes:
        right, false: exactly the true names, or the right word; a name that is not there.
    """

    request: Request
    verdict: str
    names: tuple[str, ...]
    confidence: float
    axis: str
    right: bool
    false: bool
    seconds: float


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Make logs, ask, compare with the truth."""
    worlds = [w for w, needs in WORLDS.items() if needs is None or find_spec(needs) is not None]
    jobs = [job for world in worlds for job in requests(world)]
    if request.quick:
        jobs = jobs[:: max(len(jobs) // 12, 1)]
    jobs = jobs[: request.sets]
    until = time.monotonic() + 60.0 * request.minutes
    answers: list[Scored] = run_jobs(answer, jobs, progress, "worlds", until=until)
    missing = sorted(set(WORLDS) - set(worlds))
    return {
        "logs": len(answers),
        "missing": missing,
        "rows": [_row(*key, group) for key, group in _groups(answers).items()],
        "answers": [asdict(a) for a in answers],
    }


def requests(world: str, round_of_seeds: int = 1) -> list[Request]:
    """Logs of a world; rounds share no seed."""
    if world in ("plant", "car"):
        from .random_vehicles import requests as drawn

        return [Request(world, *r) for r in drawn(world, round_of_seeds, 1)]
    module = import_module(f".{world}_car", __package__)
    return [Request(world, k, label, (), s) for k, label, s in module.requests(round_of_seeds)]


def make(request: Request) -> WorldLog:
    """Drive and measure a log."""
    kind, label, seed = request.kind, request.label, request.seed
    if request.world in ("plant", "car"):
        from .random_vehicles import make as driven

        return driven(request.world, kind, label, request.names, seed)
    log: WorldLog = import_module(f".{request.world}_car", __package__).make(kind, label, seed)
    return log


def answer(request: Request) -> Scored:
    """Ask the workflow about one log, and compare."""
    log = make(request)
    finding = investigate_log(SealedLog(log.columns, log.tables))
    axis = finding.located[0][0] if finding.located else ""
    right, false = compared(log, finding.verdict, finding.names, axis)
    confidence = min((float(e["confidence"]) for e in finding.effects), default=0.0)
    answer = (finding.verdict, finding.names, confidence, axis)
    return Scored(request, *answer, right, false, finding.seconds)


def compared(log: WorldLog, verdict: str, names: Sequence[str], axis: str) -> tuple[bool, bool]:
    """Whether an answer is right, and whether it gives a name that is not there."""
    given = frozenset(names) if verdict == "missing_effect" else frozenset()
    allowed = [frozenset(truth) for truth in log.truth]
    false = bool(given) and not any(given <= truth for truth in allowed)
    match log.kind:
        case "clean":
            return verdict == "none", false
        case "drift":
            return verdict == "parameter_drift", false
        case "outside" if not log.axes:
            return not given, false
        case "outside":
            return verdict == "unknown" and axis in log.axes, false
        case _:
            return given in allowed, false


def _groups(answers: Iterable[Scored]) -> dict[tuple[str, str], list[Scored]]:
    groups: dict[tuple[str, str], list[Scored]] = {}
    for a in answers:
        groups.setdefault((a.request.world, a.request.kind), []).append(a)
    return groups


def _row(world: str, kind: str, group: Sequence[Scored]) -> Result:
    seconds = sorted(a.seconds for a in group)
    return {
        "world": world,
        "kind": kind,
        "logs": len(group),
        "right": sum(a.right for a in group),
        "false_names": sum(a.false for a in group),
        "seconds_median": seconds[len(seconds) // 2],
        "seconds_max": seconds[-1],
    }


def show(result: Result, console: Console) -> None:
    """Print answers by world and kind."""
    table: Table = table_of(
        "vehicles drawn at random",
        *("kind", "logs", "right", "false names", "median [s]", "most [s]"),
        first="world",
    )
    for row in result["rows"]:
        cells = [str(row[key]) for key in ("world", "kind", "logs", "right", "false_names")]
        times = (f"{row[key]:.1f}" for key in ("seconds_median", "seconds_max"))
        table.add_row(*cells, *times)
    console.print(table)
    for world in result["missing"]:
        console.print(f"{world} needs the package {WORLDS[world]}: pip install '.\\[sim]'")
