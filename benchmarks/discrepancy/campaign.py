"""The whole benchmark: hide, ask, compare; other methods on the same sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from benchmarks.discrepancy import peer
from benchmarks.discrepancy.catalogue import HiddenSet, Order, make, orders
from benchmarks.discrepancy.metrics import metrics, record
from benchmarks.discrepancy.score import Outcome, score
from benchmarks.discrepancy.sealed import Inquiry, Job, seal, tables_of

Result = dict[str, Any]
Advance = Callable[[int], None]

QUICK = 0.06
"""Share of the whole benchmark that `--quick` runs."""


def total(quick: bool) -> int:
    """Steps of :func:`run`."""
    return 2 * len(orders(QUICK if quick else 1.0))


def missing() -> list[str]:
    """What could not be measured, in sentences."""
    found = []
    if not peer.available():
        found.append("pysindy is not installed: pip install slopewise[bench]")
    return found


def run(quick: bool, advance: Advance) -> Result:
    """All sets of the plant.

    Args:
        quick: a few of each kind. advance: told of each step.
    """
    wanted = orders(QUICK if quick else 1.0)
    sets = []
    for order in wanted:
        sets.append(make(order))
        advance(1)
    return judged(sets, advance)


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
