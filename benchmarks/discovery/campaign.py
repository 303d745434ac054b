"""The whole benchmark: hide, ask, compare; other methods on the same sets."""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from . import ambiguity, peer
from .catalogue import ALL, Conditions
from .engine_outcomes import engine_by_effect, engine_metrics
from .kept import Kept
from .metrics import metrics, record
from .score import Outcome
from .tasks import Done, Task, do, tasks

Result = dict[str, Any]
Advance = Callable[[int], None]

_PROCESSES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much of it.

    Attributes:
        share: of the whole catalogue, one of each kind at least. most: sets and cases at most.
        conditions: of the sets. engine: share of the engine's sets. cases: of rivals.
        seed: of all sets. minutes: after which no further set is begun.
    """

    share: float
    most: int
    conditions: Conditions
    engine: float
    cases: int
    seed: int = 1
    minutes: float = float("inf")


FULL = Size(share=1.0, most=10**6, conditions=ALL, engine=1.0, cases=24)
QUICK = Size(share=0.01, most=56, conditions=Conditions(counts=(40, 70)), engine=0.01, cases=2)


def planned(size: Size) -> list[Task]:
    """What is to be done, in order."""
    engine = size.engine if with_engine() else 0.0
    return tasks(size.share, engine, size.cases, size.seed)[: size.most]


def with_engine() -> bool:
    """The physics engine is installed."""
    return find_spec("mujoco") is not None


def missing() -> list[str]:
    """What could not be measured, in sentences."""
    found = []
    if not with_engine():
        found.append("mujoco is not installed: pip install slopewise[sim]")
    if not peer.available():
        found.append("pysindy is not installed: pip install slopewise[bench]")
    return found


def run(size: Size, advance: Advance, keep: Path | None = None) -> Result:
    """All sets, as far as time allows, on two processes.

    Args:
        size: how much. advance: told of each set done.
        keep: folder of outcomes, see :mod:`benchmarks.discovery.kept`; a set that is in it is
            not made again. A temporary one if left out.
    """
    wanted = planned(size)
    with tempfile.TemporaryDirectory(prefix="slopewise-bench-") as temporary:
        kept = Kept(keep or Path(temporary), size.conditions)
        known = kept.find()
        done = [known[task] for task in wanted if task in known]
        advance(len(done))
        for one in _all([task for task in wanted if task not in known], size, kept):
            done.append(one)
            advance(1)
    order = {task: i for i, task in enumerate(wanted)}
    return result_of(sorted(done, key=lambda d: order[d.task])) | {"planned": len(wanted)}


def _all(wanted: Iterable[Task], size: Size, kept: Kept) -> Iterator[Done]:
    end = time.monotonic() + 60.0 * size.minutes
    context = multiprocessing.get_context("spawn")
    rest = iter(wanted)
    with ProcessPoolExecutor(_PROCESSES, context, _settle) as pool:
        running: set[Any] = set()
        while True:
            while len(running) < _PROCESSES and time.monotonic() < end:
                task = next(rest, None)
                if task is None:
                    break
                running.add(pool.submit(_do, task, size.conditions, kept))
            if not running:
                return
            ready, running = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                yield future.result()


def _settle() -> None:
    """One thread each; an interruption is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def _do(task: Task, conditions: Conditions, kept: Kept) -> Done:
    done = do(task, conditions, kept.promise)
    kept.put(done)
    return done


def result_of(done: Sequence[Done]) -> Result:
    """Everything that was wanted and reached."""
    plant = [d for d in done if d.plant is not None]
    outcomes = [d.plant for d in plant if d.plant is not None]
    result: Result = {
        "sets": len(done),
        "sealed": [asdict(d.seal) for d in done],
        "metrics": [record(m) for m in metrics(outcomes)],
        "by_effect": by_effect(outcomes),
        "peer": peer.summary([d.peer for d in plant], outcomes),
        "outcomes": [o.record() for o in outcomes],
    }
    cases = [d.rivals for d in done if d.task.rivals is not None]
    if cases:
        result |= ambiguity.result_of(cases)
    engine = [d.engine for d in done if d.engine is not None]
    if engine:
        result |= {
            "engine": [record(m) for m in engine_metrics(engine)],
            "engine_by_effect": engine_by_effect(engine),
            "engine_outcomes": [asdict(o) for o in engine],
        }
    return result


def by_effect(outcomes: Sequence[Outcome]) -> list[Result]:
    """Per kind and effect: sets, identifiable ones, right and wrong names, gap closed."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        key = (outcome.kind, " + ".join(outcome.truth))
        groups.setdefault(key, []).append(outcome)
    rows = []
    for (kind, names), group in sorted(groups.items()):
        known = [o for o in group if o.identifiable]
        closed = sorted(c for o in known if (c := o.closing.share) is not None)
        verdicts: dict[str, int] = {}
        for o in known or group:
            verdicts[o.verdict] = verdicts.get(o.verdict, 0) + 1
        rows.append(
            {
                "kind": kind, "effect": names, "sets": len(group), "identifiable": len(known),
                "right": sum(o.right for o in known), "wrong": sum(o.wrong for o in group),
                "axis": sum(o.axis_right for o in known), "verdicts": verdicts,
                "closed": closed[len(closed) // 2] if closed else None,
            }
        )  # fmt: skip
    return rows
