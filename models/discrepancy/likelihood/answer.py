"""One word and the probabilities of its names, from the weights of all explanations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.discrepancy.findings import LikelyExplanation, Verdict
from slopewise.models.discrepancy.likelihood.prior import RULED_OUT, SLAB, WAVE
from slopewise.models.discrepancy.likelihood.weigh import Explanation

_ANSWERED = 0.5  # probability from which an answer is given, else `ambiguous` [1]
_COMPANION = 0.7  # probability from which a second name stands next to the first [1]


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of the weights.

    Attributes:
        verdict: one word. leader: the explanation it rests on, for `ambiguous` one with names.
        calm: the explanation without any cause.
        axis: that the heaviest causes without a name follow, "" without.
        of_names: probability that a name is right and nothing is missing next to those given.
        alternatives: explanations without some of its names that are not ruled out, the heaviest
            first.
    """

    verdict: Verdict
    leader: Explanation
    calm: Explanation
    axis: str
    of_names: Mapping[str, float]
    alternatives: tuple[Explanation, ...] = ()


def answered(every: Sequence[Explanation]) -> Answer:
    """The answer that weights give."""
    calm = next(e for e in every if not e.names and not e.axes)
    if calm.fit.noise[WAVE] > SLAB:  # in each stop, as much as an effect: speeds are no speeds
        return Answer(Verdict.UNKNOWN, calm, calm, "", {})
    share = _shares(every)
    each = list(zip(every, share, strict=True))
    axes = _summed((a, s) for e, s in each for a in e.axes)
    axis = max(axes, key=lambda a: axes[a], default="")
    # A name next to a cause without one is not certain to be what it seems.
    of_names = _summed((n, s) for e, s in each if not e.axes for n in e.names)
    if sum(s for e, s in each if e.axes) >= _ANSWERED:
        leader = next(e for e in every if e.axes)
        return Answer(Verdict.UNKNOWN, leader, calm, axis, of_names)
    if sum(s for e, s in each if not e.axes and not e.names) >= _ANSWERED:
        return Answer(Verdict.NONE, calm, calm, axis, of_names)
    named = [e for e in every if e.names and not e.axes]
    first = max(of_names, key=lambda n: of_names[n], default="")
    given = {n for n, p in of_names.items() if p >= (_ANSWERED if n == first else _COMPANION)}
    if given:
        holding = [e for e in named if first in e.names]
        leader = next((e for e in holding if e.names == given), holding[0])
        complete = [(e, s) for e, s in each if not e.axes and e.names <= leader.names]
        of_given = _summed((n, s) for e, s in complete for n in e.names)
        if of_given[first] >= RULED_OUT:  # else something is missing next to those given
            alternatives = _alternatives(every, leader)
            verdict = Verdict.MISSING_EFFECT
            return Answer(verdict, leader, calm, axis, of_given, alternatives)
    near = every[0].log_weight + np.log(RULED_OUT)
    if axis and (not named or named[0].log_weight < near):
        return Answer(Verdict.UNKNOWN, every[0], calm, axis, of_names)
    leader = named[0] if named else every[0]
    of_all = _summed((n, s) for e, s in each for n in e.names)
    alternatives = _alternatives(every, leader)
    return Answer(Verdict.AMBIGUOUS, leader, calm, axis, of_all, alternatives)


def likely(every: Sequence[Explanation]) -> tuple[LikelyExplanation, ...]:
    """Explanations that are not ruled out, the heaviest first."""
    share = _shares(every)
    return tuple(
        LikelyExplanation(tuple(sorted(e.names)), tuple(sorted(e.axes)), s)
        for e, s in zip(every, share, strict=True)
        if s > RULED_OUT * share[0]
    )


def _alternatives(every: Sequence[Explanation], leader: Explanation) -> tuple[Explanation, ...]:
    """The three heaviest that have no axis and lack a name of the leader."""
    near = leader.log_weight + np.log(RULED_OUT)
    different = [e for e in every if not e.axes and not e.names >= leader.names]
    return tuple([e for e in different if e.log_weight > near][:3])


def _shares(every: Iterable[Explanation]) -> list[float]:
    log_weight = np.array([e.log_weight for e in every])
    share = np.exp(log_weight - log_weight.max())
    return [float(s) for s in share / share.sum()]


def _summed(items: Iterable[tuple[str, float]]) -> dict[str, float]:
    total: dict[str, float] = {}
    for name, share in items:
        # Rounding makes a sum of all shares larger than 1.
        total[name] = min(total.get(name, 0.0) + share, 1.0)
    return total
