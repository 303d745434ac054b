"""Vehicles drawn at random in four worlds: which effects are named, and which are false.

The same logs are asked of a scan by generalised least squares.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from multiprocessing import util
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from ..common import campaign
from ..common.campaign import BenchmarkRequest, Progress, Result, ResultCache
from ..common.text_tables import grouped, table_of
from .blind_run import BlindRun, SealedLog
from .fresh_stops import Closing, closing, covered
from .gls_scan import name_effects
from .world_logs import WorldLog

WORLDS = {
    "plant": ("plant_world", None),
    "multibody": ("multibody_world", "vehiclemodels"),
    "engine": ("engine_car", "mujoco"),
    "rocking": ("rocking_car", "numba"),
}
"""Modules with ``requests(seed)`` and ``make(kind, label, seed)``, and the package each needs."""

_CLEAN = 75  # logs without an effect in each world
_CONFIDENT = (0.5, 0.7, 0.9, 0.99, 1.0)  # ends of the groups by stated probability [1]
_SOURCES = ("benchmarks/discrepancy", "models")


@dataclass(frozen=True, slots=True)
class Request:
    """One log: its world, and what is drawn."""

    world: str
    kind: str
    label: str
    seed: int


@dataclass(frozen=True, slots=True)
class Scored:
    """One answer next to the truth."""

    request: Request
    verdict: str
    names: tuple[str, ...]
    confidence: float
    axis: str
    right: bool  # exactly the true names, or the right word
    false: bool  # a name that is not there
    scan_right: bool  # scan_right, scan_false: those of the least-squares scan
    scan_false: bool
    # of stops held out, by the configured model, the refitted base, the finding, a perfect one [m]
    gap: tuple[float, float, float, float]
    closed: float | None  # share of the gap on fresh stops that the plant drives, else None [1]
    covered: dict[str, bool]  # whether the 95 % intervals of the plant's parameters hold the truth
    seconds: float
    text: str


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Make logs, ask, compare with the truth."""
    worlds = [w for w, (_, needs) in WORLDS.items() if needs is None or find_spec(needs)]
    jobs = spread([job for world in worlds for job in requests(world)])
    jobs = jobs[: request.sets or (12 if request.quick else None)]
    missing = sorted(set(WORLDS) - set(worlds))
    return run_logs(jobs, request, progress) | {"missing": missing}


def run_logs(jobs: Sequence[Request], request: BenchmarkRequest, progress: Progress) -> Result:
    """Answers to these logs and their sums; what is stored in the folder is not asked again."""
    until = time.monotonic() + 60.0 * request.minutes
    with tempfile.TemporaryDirectory(prefix="slopewise-bench-") as temporary:
        folder = (
            request.out or Path(temporary)
        ) / f"logs-{campaign.digest_of_sources(_SOURCES, ())}"
        stored = ResultCache(folder)
        answers: list[Scored] = campaign.run_jobs(
            answer, jobs, progress, "discrepancy", stored, until
        )
    worlds = list(WORLDS)
    ordered = sorted(answers, key=lambda a: (worlds.index(a.request.world), a.request.kind))
    groups = grouped(ordered, lambda a: (a.request.world, a.request.kind))
    return {
        "logs": len(answers),
        "planned": len(jobs),
        "rows": [_row(*key, group) for key, group in groups.items()],
        "stated": _stated(answers),
        "gaps": [gap for world in WORLDS if (gap := _gaps(world, answers))],
        "answers": [asdict(a) for a in answers],
    }


def requests(world: str, seed: int = 29) -> list[Request]:
    """Logs of a world; seeds share no log."""
    logs = import_module(f".{WORLDS[world][0]}", __package__).requests(seed)
    rng = np.random.default_rng((seed, len(logs)))
    missing = _CLEAN - sum(kind == "clean" for kind, *_ in logs)
    logs += [("clean", "", int(rng.integers(2**31))) for _ in range(missing)]
    return [Request(world, *what) for what in logs]


def spread(jobs: Sequence[Request]) -> list[Request]:
    """Shuffle so that every first part holds a fair share of each world and kind."""
    rng, seen = np.random.default_rng(5), Counter[tuple[str, str]]()
    shuffled = [jobs[i] for i in rng.permutation(len(jobs))]
    every = Counter((job.world, job.kind) for job in jobs)
    places = []
    for job in shuffled:
        key = (job.world, job.kind)
        places.append((seen[key] + rng.random()) / every[key])
        seen[key] += 1
    return [shuffled[i] for i in np.argsort(places)]


def make(request: Request) -> WorldLog:
    """Drive and measure a log."""
    world = import_module(f".{WORLDS[request.world][0]}", __package__)
    log: WorldLog = world.make(request.kind, request.label, request.seed)
    return log


@cache
def _blind_run() -> BlindRun:
    """The one investigating process for all logs of this process."""
    process = BlindRun()
    # A worker process joins its children before it runs what is registered with atexit, and
    # before that it closes queues, at priority 10: the end has to be sent earlier.
    util.Finalize(None, process.close, exitpriority=100)
    return process


def answer(request: Request) -> Scored:
    """Ask both methods about one log, and compare."""
    log = make(request)
    finding = _blind_run().investigate(SealedLog(log.columns, log.tables))
    axis = finding.located[0][0] if finding.located else ""
    right, false = compared(log, finding.verdict, finding.names, axis)
    confidence = min((float(e["confidence"]) for e in finding.effects), default=0.0)
    known = {key: float(log.tables["braking"][key]) for key in finding.braking or ()}
    try:
        named = name_effects(log.columns, known)
    except (ValueError, KeyError, np.linalg.LinAlgError):
        named = ()
    scan = compared(log, "missing_effect" if named else "none", named, "")
    closed, holds = None, dict[str, bool]()
    if log.hidden is not None and log.kind in ("single", "pair", "drift"):
        closed = closing(log.hidden, finding).share
        holds = covered(log.hidden.hidden, finding) if finding.is_confident else {}
    return Scored(
        request,
        *(finding.verdict, finding.names, confidence, axis, right, false, *scan, finding.gap),
        *(closed, holds, finding.seconds, finding.text),
    )


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


def _row(world: str, kind: str, group: Sequence[Scored]) -> Result:
    flags = [(a.right, a.false, a.scan_right, a.scan_false) for a in group]
    right, false, scan_right, scan_false = (sum(column) for column in zip(*flags, strict=True))
    interval = binomtest(right, len(group)).proportion_ci(method="wilson")
    seconds = sorted(a.seconds for a in group)
    return {
        "world": world,
        "kind": kind,
        "logs": len(group),
        "right": right,
        "right_ci95": [float(interval.low), float(interval.high)],
        "false_names": false,
        "scan_right": None if kind in ("drift", "outside") else scan_right,
        "scan_false_names": scan_false,
        "faults": sum(a.verdict == "fault" for a in group),
        "seconds_median": seconds[len(seconds) // 2],
        "seconds_max": seconds[-1],
    }


def _stated(answers: Sequence[Scored]) -> list[Result]:
    """Right answers among those named with about the same probability."""
    named = [a for a in answers if a.verdict == "missing_effect"]
    rows = []
    for low, high in pairwise(_CONFIDENT):
        group = [a for a in named if low <= a.confidence < high or a.confidence == high == 1.0]
        if group:
            mean = float(np.mean([a.confidence for a in group]))
            rows.append({"stated": mean, "logs": len(group), "right": sum(a.right for a in group)})
    return rows


def _gaps(world: str, answers: Sequence[Scored]) -> Result | None:
    """Gaps of stops held out that could be closed, of logs with something to find."""
    mine = [a for a in answers if a.request.world == world and a.gap[3] > 0.0]
    kinds = ("single", "pair", "drift")
    gaps = [Closing(a.gap[0], *a.gap[2:]) for a in mine if a.request.kind in kinds]
    shares = [gap.share for gap in gaps if gap.share is not None]
    if not shares:
        return None
    fresh = [a.closed for a in mine if a.closed is not None]
    holds = [hold for a in mine for hold in a.covered.values()]
    return {
        "world": world,
        "logs": len(shares),
        "closed_median": float(np.median(shares)),
        "larger": sum(a.gap[2] > 1.02 * a.gap[0] for a in mine),
        "of": len(mine),
        "closed_fresh_median": float(np.median(fresh)) if fresh else None,
        "covered": [sum(holds), len(holds)] if holds else None,
    }


def show(result: Result, console: Console) -> None:
    """Print answers by world and kind, by stated probability, and gaps."""
    console.print(_answer_table(result["rows"]))
    table = table_of("names by stated probability", "logs", "right", first="stated")
    for row in result["stated"]:
        table.add_row(f"{row['stated']:.1%}", str(row["logs"]), f"{row['right'] / row['logs']:.0%}")
    console.print(table)
    console.print(_gap_table(result["gaps"]))
    for world in result.get("missing", ()):
        console.print(f"{world} needs the package {WORLDS[world][1]}: pip install '.\\[sim]'")


def _answer_table(rows: Sequence[Result]) -> Table:
    names = ("false names", "scan: right", "false names")
    columns = ("kind", "logs", "right", "95 %", *names, "median [s]", "most [s]")
    table = table_of("vehicles drawn at random", *columns, first="world")
    for row in rows:
        low, high = row["right_ci95"]
        cells = [str(row[key]) for key in ("world", "kind", "logs", "right")]
        cells += [f"{low:.0%} … {high:.0%}", str(row["false_names"])]
        cells += ["–" if row["scan_right"] is None else str(row["scan_right"])]
        cells += [str(row["scan_false_names"])]
        table.add_row(*cells, *(f"{row[key]:.1f}" for key in ("seconds_median", "seconds_max")))
    return table


def _gap_table(rows: Sequence[Result]) -> Table:
    columns = ("logs", "closed, median", "larger by > 2 %", "fresh stops, median", "95 % intervals")
    table = table_of("gap on stops held out", *columns, first="world")
    for row in rows:
        fresh, holds = row["closed_fresh_median"], row["covered"]
        cells = [row["world"], str(row["logs"]), f"{row['closed_median']:.0%}"]
        cells += [f"{row['larger']} of {row['of']}", "–" if fresh is None else f"{fresh:.0%}"]
        table.add_row(*cells, "–" if holds is None else f"{holds[0]} of {holds[1]} hold")
    return table
