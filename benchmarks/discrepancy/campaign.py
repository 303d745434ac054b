"""The whole benchmark: hide, ask, compare; other methods on the same sets."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..common.jobs import finished
from . import ambiguity, peer, peers
from .catalogue import ALL, SetConditions
from .engine_outcomes import NAMES as ENGINE_NAMES
from .engine_outcomes import engine_metrics
from .kept import KeptSets
from .metrics import effect_row, metrics, record
from .multibody_outcomes import NAMES as CAR_NAMES
from .multibody_outcomes import multibody_metrics
from .score import SetOutcome
from .tasks import FinishedSet, SetTask, do, tasks
from .world_outcomes import by_what

Result = dict[str, Any]
Advance = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class SetCounts:
    """How much of it.

    Attributes:
        share: of the whole catalogue, one of each kind at least. most: sets and cases at most.
        conditions: of the sets. engine: share of the engine's sets. cases: of rivals.
        seed: of all sets. minutes: after which no further set is begun.
        multibody: share of the sealed sets of the multi-body car.
    """

    share: float
    most: int
    conditions: SetConditions
    engine: float
    cases: int
    seed: int = 1
    minutes: float = float("inf")
    multibody: float = 0.0


FULL = SetCounts(share=1.0, most=10**6, conditions=ALL, engine=1.0, cases=24, multibody=0.25)
QUICK = SetCounts(
    share=0.01,
    most=68,
    conditions=SetConditions(counts=(40, 70)),
    engine=0.01,
    cases=2,
    multibody=0.01,
)


def planned(size: SetCounts) -> list[SetTask]:
    """What is to be done, in order."""
    engine = size.engine if with_engine() else 0.0
    multibody = size.multibody if with_car() else 0.0
    return tasks(size.share, engine, size.cases, size.seed, multibody)[: size.most]


def with_engine() -> bool:
    """The physics engine is installed."""
    return find_spec("mujoco") is not None


def with_car() -> bool:
    """The multi-body car is installed."""
    return find_spec("vehiclemodels") is not None


def missing() -> list[str]:
    """What could not be measured, in sentences."""
    found = []
    if not with_engine():
        found.append("mujoco is not installed: pip install '.[sim]' in a clone")
    if not with_car():
        found.append("commonroad-vehicle-models is not installed: pip install '.[sim]' in a clone")
    if not peer.available():
        found.append("pysindy is not installed: pip install '.[bench]' in a clone")
    return found


def run(size: SetCounts, advance: Advance, keep: Path | None = None) -> Result:
    """All sets, as far as time allows, on two processes.

    Args:
        size: how much. advance: told of each set done.
        keep: folder of outcomes, see :mod:`benchmarks.discovery.kept`; a set that is in it is
            not made again. A temporary one if left out.
    """
    wanted = planned(size)
    with tempfile.TemporaryDirectory(prefix="slopewise-bench-") as temporary:
        kept = KeptSets(keep or Path(temporary), size.conditions)
        known = kept.find()
        done = [known[task] for task in wanted if task in known]
        advance(len(done))
        rest = [task for task in wanted if task not in known]
        until = time.monotonic() + 60.0 * size.minutes
        do_one = partial(_do, conditions=size.conditions, kept=kept)
        for _, one in finished(do_one, rest, "spawn", _settle, until=until):
            done.append(one)
            advance(1)
    order = {task: i for i, task in enumerate(wanted)}
    return result_of(sorted(done, key=lambda d: order[d.task])) | {"planned": len(wanted)}


def _settle() -> None:
    """One thread each; an interruption is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def _do(task: SetTask, conditions: SetConditions, kept: KeptSets) -> FinishedSet:
    done = do(task, conditions, kept.promise)
    kept.put(done)
    return done


def result_of(done: Sequence[FinishedSet]) -> Result:
    """Everything that was wanted and reached."""
    plant = [d for d in done if d.plant is not None]
    outcomes = [d.plant for d in plant if d.plant is not None]
    result: Result = {
        "sets": len(done),
        "sealed": [asdict(d.seal) for d in done],
        "metrics": [record(m) for m in metrics(outcomes)],
        "by_effect": by_effect(outcomes),
        "peer": peers.summary([d.peers for d in plant], outcomes),
        "outcomes": [o.record() for o in outcomes],
    }
    cases = [d.rivals for d in done if d.task.rivals is not None]
    if cases:
        result |= ambiguity.result_of(cases)
    engine = [d.engine for d in done if d.engine is not None]
    if engine:
        result |= {
            "engine": [record(m) for m in engine_metrics(engine)],
            "engine_by_effect": by_what("engine", engine),
            "engine_outcomes": [asdict(o) for o in engine],
            "engine_peer": peers.world_summary(
                [d.peers for d in done if d.engine is not None], engine, ENGINE_NAMES
            ),
        }
    cars = [d.multibody for d in done if d.multibody is not None]
    if cars:
        result |= {
            "multibody": [record(m) for m in multibody_metrics(cars)],
            "multibody_by_effect": by_what("multibody", cars),
            "multibody_outcomes": [asdict(o) for o in cars],
            "multibody_peer": peers.world_summary(
                [d.peers for d in done if d.multibody is not None], cars, CAR_NAMES
            ),
        }
    return result


def by_effect(outcomes: Sequence[SetOutcome]) -> list[Result]:
    """Per kind and effect: sets, identifiable ones, right and wrong names, gap closed."""
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
