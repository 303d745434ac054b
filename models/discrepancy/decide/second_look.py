"""Explanations weighed once more, with a base whose shape along a stop may be a little wrong."""

from __future__ import annotations

from dataclasses import replace

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.search.identify import Identified, ScoredExplanation, score
from slopewise.models.discrepancy.search.refine import fit_either_way
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS


def weighed_again(table: StopTable, found: Identified, doubt: float) -> Identified | None:
    """The outcome of a search with its best explanations, and their parts, weighed once more.

    Args:
        table: stops. found: outcome so far, with names. doubt: χ² that explanations may differ by
            and be as good as one another.

    Returns:
        None where there is nothing to weigh: one explanation, and no term of motion beside others.
    """
    best = found.best
    near = [e for e in found.others if e.names and e.score < best.score + doubt]
    if not near and (len(best.names) == 1 or not _without_motion(best.fit.hypothesis)):
        return None
    near += [e for e in found.others if not e.names]
    asked: dict[tuple[str, ...], Hypothesis] = {}
    for explanation in (best, *near):
        hypothesis = explanation.fit.hypothesis
        for part in (hypothesis, *_without_motion(hypothesis)):
            asked.setdefault(tuple(sorted(part.names)), part)
    noise, looked = best.fit.noise, []
    for part in asked.values():
        bent = fit_either_way(table, replace(part, bends=True), noise, rounds=1)
        looked.append(ScoredExplanation(bent, score(bent, len(table))))
    looked.sort(key=lambda e: e.score)
    rest = [e for e in found.others if e.names not in asked]
    return replace(found, best=looked[0], others=(*looked[1:], *rest))


def _without_motion(hypothesis: Hypothesis) -> list[Hypothesis]:
    """Without each of its terms of motion: a base of the wrong shape looks like them."""
    added = hypothesis.added
    return [
        replace(hypothesis, added=(*added[:i], *added[i + 1 :]))
        for i, effect in enumerate(added)
        if LAWS[effect.name].enters is Enters.MOTION
    ]
