"""The whole benchmark: hide, ask, compare; other methods on the same sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from benchmarks.discrepancy import ambiguity, peer
from benchmarks.discrepancy.catalogue import ALL, Conditions, HiddenSet, Order, make, orders
from benchmarks.discrepancy.metrics import metrics, record
from benchmarks.discrepancy.score import Outcome, score
from benchmarks.discrepancy.sealed import Inquiry, Job, seal, tables_of

if TYPE_CHECKING:
    from benchmarks.discrepancy.engine_sets import EngineOrder

Result = dict[str, Any]
Advance = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much of it.

    Attributes:
        share: of the whole catalogue, one of each kind at least; most: sets of each world at most.
        conditions: of the sets. engine: share of the engine's sets. cases: of rivals.
    """

    share: float
    most: int
    conditions: Conditions
    engine: float
    cases: int


FULL = Size(share=1.0, most=10**6, conditions=ALL, engine=1.0, cases=24)
QUICK = Size(share=0.01, most=36, conditions=Conditions(counts=(40, 70)), engine=0.01, cases=2)


def total(quick: bool) -> int:
    """Steps of :func:`run`."""
    size = QUICK if quick else FULL
    engine = 2 * len(_engine_orders(size)) if with_engine() else 0
    return 2 * len(orders(size.share)[: size.most]) + size.cases + engine


def with_engine() -> bool:
    """The physics engine is installed."""
    return find_spec("mujoco") is not None


def _engine_orders(size: Size) -> list[EngineOrder]:
    from benchmarks.discrepancy.engine_sets import engine_orders

    return engine_orders(size.engine)[: size.most]


def missing() -> list[str]:
    """What could not be measured, in sentences."""
    found = []
    if not with_engine():
        found.append("mujoco is not installed: pip install slopewise[sim]")
    if not peer.available():
        found.append("pysindy is not installed: pip install slopewise[bench]")
    return found


def run(quick: bool, advance: Advance) -> Result:
    """All sets of the plant, then those of the engine.

    Args:
        quick: a few of each kind. advance: told of each step.
    """
    size = QUICK if quick else FULL
    sets = []
    for order in orders(size.share)[: size.most]:
        sets.append(make(order, size.conditions))
        advance(1)
    result = judged(sets, advance)
    result |= ambiguity.run(ambiguity.cases(size.cases), advance)
    if with_engine():
        result |= in_the_engine(_engine_orders(size), advance)
    return result


def in_the_engine(wanted: Sequence[EngineOrder], advance: Advance) -> Result:
    """The sets of the physics engine."""
    from benchmarks.discrepancy import engine_sets

    configured = engine_sets.calibrated()
    sets = []
    for order in wanted:
        sets.append(engine_sets.make(order, configured))
        advance(1)
    promise = seal([engine_sets.truth_of(one) for one in sets])
    findings = []
    with Inquiry() as inquiry:
        for one in sets:
            findings.append(inquiry.ask(Job(one.columns, tables_of(one.configured))))
            advance(1)
    outcomes = [engine_sets.judge(s, f) for s, f in zip(sets, findings, strict=True)]
    return {
        "engine_sealed": asdict(promise),
        "engine": [record(m) for m in engine_sets.engine_metrics(outcomes)],
        "engine_by_effect": engine_sets.engine_by_effect(outcomes),
        "engine_outcomes": [asdict(o) for o in outcomes],
    }


def judged(sets: Sequence[HiddenSet], advance: Advance) -> Result:
    """Seal the truths, have every log investigated, then compare."""
    promise = seal([truth_of(hidden) for hidden in sets])
    findings, other = [], []
    with Inquiry() as inquiry:
        for hidden in sets:
            findings.append(inquiry.ask(Job(hidden.columns, tables_of(hidden.configured))))
            other.append(peer.name_effects(hidden.columns, hidden.configured))
            advance(1)
    outcomes = [score(h, f) for h, f in zip(sets, findings, strict=True)]
    return {
        "sealed": asdict(promise),
        "metrics": [record(m) for m in metrics(outcomes)],
        "by_effect": by_effect(outcomes),
        "peer": peer.summary(sets, other, outcomes),
        "outcomes": [o.record() for o in outcomes],
    }


def truth_of(hidden: HiddenSet) -> dict[str, Any]:
    """What is true of a set, for the sealed file."""
    order: Order = hidden.order
    return asdict(order) | {
        "hidden": [asdict(effect) for effect in hidden.hidden],
        "physics": hidden.truth._asdict(),
        "worth": asdict(hidden.worth),
    }


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
