"""What is done with one set: make it, seal its truth, ask, compare. Any process may do it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache
from multiprocessing import util
from typing import TYPE_CHECKING, Any

import numpy as np

from . import ambiguity, catalogue, peers
from .ambiguity import Resolved
from .catalogue import HiddenSet, Order, SetConditions, spread
from .engine_outcomes import engine_orders
from .model_tables import tables_of
from .multibody_outcomes import multibody_orders
from .peers import PeerAnswer
from .score import SetOutcome, score
from .sealed import Inquiry, InquiryFinding, Seal, SealedLog, seal
from .world_outcomes import WorldOrder, WorldOutcome

if TYPE_CHECKING:
    from .worlds import WorldSet


@dataclass(frozen=True, slots=True)
class SetTask:
    """One of: a set of the plant, of the engine, of the car, a case of rivals by its number."""

    plant: Order | None = None
    engine: WorldOrder | None = None
    rivals: int | None = None
    multibody: WorldOrder | None = None

    @property
    def world(self) -> str:
        """Which of them it is."""
        if self.multibody:
            return "multibody"
        return "plant" if self.plant else "engine" if self.engine else "rivals"


@dataclass(frozen=True, slots=True)
class FinishedSet:
    """What became of a task.

    Attributes:
        task: that was done. seal: of the truth, promised before anything was asked.
        plant, engine, rivals, multibody: outcome of a task of that kind; rivals may remain None.
        peers: what the other methods named, those that are installed and were asked.
    """

    task: SetTask
    seal: Seal
    plant: SetOutcome | None = None
    engine: WorldOutcome | None = None
    rivals: Resolved | None = None
    multibody: WorldOutcome | None = None
    peers: dict[str, PeerAnswer] = field(default_factory=dict)


def tasks(
    share: float, engine: float, cases: int, seed: int = 1, multibody: float = 0.0
) -> list[SetTask]:
    """All of a benchmark; every first part of it holds a fair share of each family.

    Args:
        share: of the plant's catalogue. engine: of the engine's, 0 for none. cases: of rivals.
        seed: of sets and order. multibody: share of the sealed sets of the car, 0 for none.
    """
    found = [SetTask(plant=order) for order in catalogue.orders(share, seed)]
    if engine > 0.0:
        found += [SetTask(engine=order) for order in engine_orders(engine, seed)]
    if multibody > 0.0:
        orders = multibody_orders(multibody, "sealed", seed)
        found += [SetTask(multibody=order) for order in orders]
    found += [SetTask(rivals=1000 * seed + number) for number in range(cases)]
    return spread(found, lambda task: task.world, np.random.default_rng((5, seed)))


def do(
    task: SetTask,
    conditions: SetConditions,
    promise: Callable[[str], None],
    *,
    with_peers: bool = True,
) -> FinishedSet:
    """Make a set, promise its truth, have it investigated, compare.

    Args:
        task: what. conditions: of the plant's sets.
        promise: told of the digest of the truth before anything is asked.
        with_peers: the other methods are asked, too.
    """
    if task.engine is not None:
        return _in_the_engine(task, task.engine, promise, with_peers)
    if task.multibody is not None:
        return _with_the_car(task, task.multibody, promise, with_peers)
    if task.rivals is not None:
        case = ambiguity.case(task.rivals)
        sealed = _sealed([] if case is None else truth_of(case), promise)
        resolved = None if case is None else ambiguity.resolve(case, _inquiry())
        return FinishedSet(task, sealed, rivals=resolved)
    assert task.plant is not None
    hidden = catalogue.make(task.plant, conditions)
    sealed = _sealed(truth_of(hidden), promise)
    finding = _inquiry().ask(SealedLog(hidden.columns, tables_of(hidden.configured)))
    others = peers.ask(hidden.columns, hidden.configured) if with_peers else {}
    return FinishedSet(task, sealed, plant=score(hidden, finding), peers=others)


def _in_the_engine(
    task: SetTask, order: WorldOrder, promise: Callable[[str], None], with_peers: bool
) -> FinishedSet:
    from . import engine_sets, worlds

    one = worlds.make(engine_sets.ENGINE, order, engine_sets.calibrated)
    sealed, finding = _asked(one, None, promise)
    others = peers.ask(one.columns, one.configured) if with_peers else {}
    outcome = worlds.judge(engine_sets.ENGINE, one, finding)
    return FinishedSet(task, sealed, engine=outcome, peers=others)


def _with_the_car(
    task: SetTask, order: WorldOrder, promise: Callable[[str], None], with_peers: bool
) -> FinishedSet:
    from . import multibody_sets, worlds

    one = worlds.make(multibody_sets.MULTIBODY, order, multibody_sets.calibrated)
    sealed, finding = _asked(one, multibody_sets.car_table(), promise)
    outcome = worlds.judge(multibody_sets.MULTIBODY, one, finding)
    others = peers.ask(one.columns, one.configured) if with_peers else {}
    return FinishedSet(task, sealed, multibody=outcome, peers=others)


def _asked(
    one: WorldSet[Any], vehicle: dict[str, Any] | None, promise: Callable[[str], None]
) -> tuple[Seal, InquiryFinding]:
    sealed = _sealed(one.truth(), promise)
    return sealed, _inquiry().ask(SealedLog(one.columns, tables_of(one.configured, vehicle)))


def _sealed(truth: Any, promise: Callable[[str], None]) -> Seal:
    sealed = seal([truth])
    promise(sealed.digest)
    return sealed


@cache
def _inquiry() -> Inquiry:
    """One for all tasks of this process."""
    inquiry = Inquiry()
    # A worker process joins its children before it runs what is registered with atexit, and
    # before that it closes queues, at priority 10: the end has to be sent earlier.
    util.Finalize(None, inquiry.close, exitpriority=100)
    return inquiry


def truth_of(hidden: HiddenSet) -> dict[str, Any]:
    """What is true of a set, for the sealed file."""
    return asdict(hidden.order) | {
        "hidden": [asdict(effect) for effect in hidden.hidden],
        "physics": hidden.truth._asdict(),
        "worth": asdict(hidden.worth),
    }
