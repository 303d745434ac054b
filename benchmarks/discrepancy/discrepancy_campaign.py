"""The benchmark of missing effects: hide, investigate blindly, score; with baselines."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console

from ..common.campaign import BenchmarkRequest, Progress, run_jobs
from ..common.result_cache import LineCache, digest_of_sources
from . import ambiguity, baselines
from .catalogue import ALL, SetConditions
from .discrepancy_metrics import effect_row, metrics, record
from .discrepancy_tables import tables
from .score import SetOutcome
from .tasks import FinishedSet, SetTask, run_task, tasks
from .world_outcomes import (
    CAR_NAMES,
    ENGINE_NAMES,
    by_what,
    engine_metrics,
    multibody_metrics,
    multibody_specs,
)

Result = dict[str, Any]

_SOURCES = (
    "benchmarks/discrepancy",
    "models/discrepancy",
    "models/calibration",
    "models/effects",
    "models/laws",
    "models/stop_logs",
    "models/stops",
)
_PACKAGES = {"mujoco": "mujoco", "commonroad-vehicle-models": "vehiclemodels"}
_IGNORED_SOURCES = ("discrepancy_campaign.py", "discrepancy_metrics.py", "discrepancy_tables.py")


@dataclass(frozen=True, slots=True, kw_only=True)
class SetCounts:
    """Size of a run.

    Attributes:
        share: share of the plant's catalogue, one set of each kind at least.
        max_sets: maximum number of sets and cases.
        conditions: conditions of the plant's sets.
        engine: share of the engine's sets.
        cases: number of ambiguous cases.
        seed: determines all sets.
        minutes: time after which no further set is started [min].
        multibody: share of the sealed sets of the multi-body car.
        tuning: share of the car's tuning half; if positive, no other set is run.
    """

    share: float
    max_sets: int
    conditions: SetConditions
    engine: float
    cases: int
    seed: int = 1
    minutes: float = float("inf")
    multibody: float = 0.0
    tuning: float = 0.0


FULL = SetCounts(share=1.0, max_sets=10**6, conditions=ALL, engine=1.0, cases=24, multibody=0.25)
QUICK = SetCounts(
    share=0.01,
    max_sets=68,
    conditions=SetConditions(counts=(40, 70)),
    engine=0.01,
    cases=2,
    multibody=0.01,
)


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Run all sets, as far as time allows, on two processes."""
    size = replace(
        QUICK if request.quick else FULL, minutes=request.minutes, tuning=request.tuning_share
    )
    if request.sets is not None:
        size = replace(size, max_sets=request.sets)
    return run_sets(planned(size), size, progress, request.out)


def show(result: Result, console: Console) -> None:
    """Print all tables, and the worlds that could not be run."""
    for table in tables(result):
        console.print(table)
    for package in result.get("missing", ()):
        console.print(f"{package} is not installed: pip install '.\\[sim]' in a clone")


def planned(size: SetCounts) -> list[SetTask]:
    """Tasks of a run, in order."""
    if size.tuning > 0.0:
        specs = multibody_specs(size.tuning, "tuning", size.seed)
        return [SetTask(multibody=spec) for spec in specs][: size.max_sets]
    engine = size.engine if find_spec("mujoco") is not None else 0.0
    multibody = size.multibody if find_spec("vehiclemodels") is not None else 0.0
    return tasks(size.share, engine, size.cases, size.seed, multibody)[: size.max_sets]


def run_sets(
    todo: Sequence[SetTask], size: SetCounts, progress: Progress, folder: Path | None = None
) -> Result:
    """Run tasks on two processes.

    Args:
        todo: tasks.
        size: conditions and minutes.
        progress: see :data:`.campaign.Progress`.
        folder: of stored outcomes, which are not computed again; default: a temporary one.
    """
    advance = progress("discrepancy", len(todo))
    with tempfile.TemporaryDirectory(prefix="slopewise-bench-") as temporary:
        cache = SetCache(folder or Path(temporary), size.conditions)
        known = cache.find()
        finished = [known[task] for task in todo if task in known]
        advance(len(finished))
        missing = [task for task in todo if task not in known]
        until = time.monotonic() + 60.0 * size.minutes
        work = partial(_run_and_store, conditions=size.conditions, cache=cache)
        for _, result in run_jobs(work, missing, "spawn", _prepare, until=until):
            finished.append(result)
            advance(1)
    order = {task: i for i, task in enumerate(todo)}
    finished.sort(key=lambda f: order[f.task])
    missing_packages = [name for name, module in _PACKAGES.items() if find_spec(module) is None]
    return result_of(finished) | {"planned": len(todo), "missing": missing_packages}


def _prepare() -> None:
    """Use one thread, and leave interruptions to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def _run_and_store(task: SetTask, conditions: SetConditions, cache: SetCache) -> FinishedSet:
    finished = run_task(task, conditions, cache.announce)
    cache.put(finished)
    return finished


class SetCache:
    """Outcomes of one state of the sources under one set of conditions, a line of JSON each.

    Attributes:
        outcomes: file of the outcomes.
        digests: file of announced digests.
    """

    def __init__(self, folder: Path, conditions: SetConditions) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        name = digest_of_sources(_SOURCES, _IGNORED_SOURCES, repr(conditions))[:16]
        self.outcomes = LineCache(folder / f"sets-{name}.jsonl")
        self.digests = LineCache(folder / f"digests-{name}.txt")

    def find(self) -> dict[SetTask, FinishedSet]:
        """Stored results by task."""
        return {result.task: result for result in self.outcomes.decode(FinishedSet)}

    def put(self, finished: FinishedSet) -> None:
        """Store a result."""
        self.outcomes.append(b"\n" + msgspec.json.encode(finished))

    def announce(self, digest: str) -> None:
        """Store the digest of a truth before its log is sent."""
        self.digests.append(digest.encode() + b"\n")


def result_of(finished: Sequence[FinishedSet]) -> Result:
    """Targets and values reached, as plain data."""
    plant = [f for f in finished if f.plant is not None]
    outcomes = [f.plant for f in plant if f.plant is not None]
    result: Result = {
        "sets": len(finished),
        "sealed": [asdict(f.commitment) for f in finished],
        "metrics": [record(m) for m in metrics(outcomes)],
        "by_effect": by_effect(outcomes),
        "peer": baselines.summary([f.baselines for f in plant], outcomes),
        "outcomes": [o.record() for o in outcomes],
    }
    cases = [f.ambiguous for f in finished if f.task.ambiguous is not None]
    if cases:
        result |= ambiguity.result_of(cases)
    for key, world_metrics, names in (
        ("engine", engine_metrics, ENGINE_NAMES),
        ("multibody", multibody_metrics, CAR_NAMES),
    ):
        own = [(f, o) for f in finished if (o := getattr(f, key)) is not None]  # words: ok
        answers, scored = [f.baselines for f, _ in own], [o for _, o in own]
        if scored:
            result |= {
                key: [record(m) for m in world_metrics(scored)],
                f"{key}_by_effect": by_what(key, scored),
                f"{key}_outcomes": [asdict(o) for o in scored],
                f"{key}_peer": baselines.world_summary(answers, scored, names),
            }
    return result


def by_effect(outcomes: Sequence[SetOutcome]) -> list[Result]:
    """Counts by kind and effect."""
    groups: dict[tuple[str, str], list[SetOutcome]] = {}
    for outcome in outcomes:
        key = (outcome.kind, " + ".join(outcome.truth))
        groups.setdefault(key, []).append(outcome)
    rows = []
    for (kind, names), group in sorted(groups.items()):
        known = [o for o in group if o.identifiable]
        closed, axis = [o.closing.share for o in known], sum(o.axis_right for o in known)
        rows.append(effect_row(kind, names, group, known, closed, axis))
    return rows
