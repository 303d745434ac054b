"""One task: make a set, commit to its truth, investigate it blindly, score the finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache
from multiprocessing import util
from typing import Any

import numpy as np

from . import ambiguity, baselines, catalogue
from .ambiguity import Resolved
from .baselines import BaselineAnswer
from .blind_run import BlindRun, SealedLog, TruthCommitment, commit, tables_of
from .catalogue import HiddenSet, SetConditions, SetSpec, spread
from .score import SetOutcome, score
from .world_outcomes import WorldOutcome, WorldSpec, engine_specs, multibody_specs

Announce = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class SetTask:
    """One of: a set of the plant, of the engine, of the car, an ambiguous case by its number."""

    plant: SetSpec | None = None
    engine: WorldSpec | None = None
    ambiguous: int | None = None
    multibody: WorldSpec | None = None

    @property
    def world(self) -> str:
        """Kind of the task."""
        if self.multibody:
            return "multibody"
        return "plant" if self.plant else "engine" if self.engine else "ambiguous"


@dataclass(frozen=True, slots=True)
class FinishedSet:
    """Result of a task.

    Attributes:
        task: completed task.
        commitment: to the truth, announced before the log was sent.
        plant, engine, ambiguous, multibody: outcome of a task of that kind; an ambiguous case
            without alternatives has none.
        baselines: answers of the other methods.
    """

    task: SetTask
    commitment: TruthCommitment
    plant: SetOutcome | None = None
    engine: WorldOutcome | None = None
    ambiguous: Resolved | None = None
    multibody: WorldOutcome | None = None
    baselines: dict[str, BaselineAnswer] = field(default_factory=dict)


def tasks(
    share: float, engine: float, cases: int, seed: int = 1, multibody: float = 0.0
) -> list[SetTask]:
    """All tasks; every first part of the list holds a fair share of each family.

    Args:
        share: share of the plant's catalogue.
        engine: share of the engine's sets, 0 for none.
        cases: number of ambiguous cases.
        seed: of sets and order.
        multibody: share of the sealed sets of the car, 0 for none.
    """
    todo = [SetTask(plant=spec) for spec in catalogue.specs(share, seed)]
    if engine > 0.0:
        todo += [SetTask(engine=spec) for spec in engine_specs(engine, seed)]
    if multibody > 0.0:
        todo += [SetTask(multibody=s) for s in multibody_specs(multibody, "sealed", seed)]
    todo += [SetTask(ambiguous=1000 * seed + number) for number in range(cases)]
    return spread(todo, lambda task: task.world, np.random.default_rng((5, seed)))


def run_task(task: SetTask, conditions: SetConditions, announce: Announce) -> FinishedSet:
    """Make a set, commit to its truth, investigate, score.

    Args:
        task: request.
        conditions: conditions of the plant's sets.
        announce: receives the digest of the truth before the log is sent.
    """
    if task.engine is not None or task.multibody is not None:
        return _world_task(task, announce)
    if task.ambiguous is not None:
        case = ambiguity.case(task.ambiguous)
        commitment = _commit([] if case is None else truth_of(case), announce)
        resolved = None if case is None else ambiguity.resolve(case, _blind_run())
        return FinishedSet(task, commitment, ambiguous=resolved)
    assert task.plant is not None
    hidden = catalogue.make(task.plant, conditions)
    commitment = _commit(truth_of(hidden), announce)
    finding = _blind_run().investigate(SealedLog(hidden.columns, tables_of(hidden.configured)))
    answers = baselines.ask_all(hidden.columns, hidden.configured)
    return FinishedSet(task, commitment, plant=score(hidden, finding), baselines=answers)


def _world_task(task: SetTask, announce: Announce) -> FinishedSet:
    """Run a set of one of the physics engines, which only the worker process imports."""
    from . import worlds

    vehicle: dict[str, Any] | None = None
    world: worlds.World[Any]
    configured: Callable[[Any], dict[str, float]]
    if task.engine is not None:
        from . import engine_sets

        spec, world = task.engine, engine_sets.ENGINE
        configured = engine_sets.calibrated
    else:
        from . import multibody_sets

        assert task.multibody is not None
        spec, world = task.multibody, multibody_sets.MULTIBODY
        configured, vehicle = multibody_sets.calibrated, multibody_sets.car_table()
    hidden: worlds.WorldSet[Any] = worlds.make(world, spec, configured)
    commitment = _commit(hidden.truth(), announce)
    tables = tables_of(hidden.configured, vehicle)
    finding = _blind_run().investigate(SealedLog(hidden.columns, tables))
    answers = baselines.ask_all(hidden.columns, hidden.configured)
    outcome = worlds.score_world(world, hidden, finding)
    if task.engine is not None:
        return FinishedSet(task, commitment, engine=outcome, baselines=answers)
    return FinishedSet(task, commitment, multibody=outcome, baselines=answers)


def _commit(truth: Any, announce: Announce) -> TruthCommitment:
    commitment = commit([truth])
    announce(commitment.digest)
    return commitment


@cache
def _blind_run() -> BlindRun:
    """The one investigating process for all tasks of this process."""
    process = BlindRun()
    # A worker process joins its children before it runs what is registered with atexit, and
    # before that it closes queues, at priority 10: the end has to be sent earlier.
    util.Finalize(None, process.close, exitpriority=100)
    return process


def truth_of(hidden: HiddenSet) -> dict[str, Any]:
    """Truth of a set, for the commitment."""
    return asdict(hidden.spec) | {
        "hidden": [asdict(effect) for effect in hidden.hidden],
        "physics": hidden.truth._asdict(),
        "identifiability": asdict(hidden.identifiability),
    }
