"""Places and times of change, which have no derivative, and how well they are known.

The edge of a patch matters only where a stop crosses it, and the run of a change only between runs:
the likelihood is flat in between and jumps at the edges. Many are tried in addition to all other
effects of the explanation; the interval holds those that likelihood does not exclude (Wilks), as
the standard deviation of a normal distribution with the same 95 %.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate, circles
from slopewise.models.discrepancy.likelihood.gaussian import Grams, Precision, products
from slopewise.models.discrepancy.likelihood.marginal import solved_both
from slopewise.models.discrepancy.likelihood.onset import Integrated, Moment
from slopewise.models.discrepancy.likelihood.posterior import Explanation
from slopewise.models.discrepancy.likelihood.trace import columns_at, size_of
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import stops_seen
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.surface_patch import holds_stops, share_inside

Extent = dict[str, float]
"""Standard deviations of such numbers, by name."""

_TRIED = 48  # patches around one of them in a round: enough for three numbers
_REACHES = (0.5, 0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.07, 0.05, 0.03, 0.02)
"""How far the best patch is moved in each round, coarse to fine, share of its radius [1]."""
_ROUNDS = 18  # in which the extent is followed: three to each side of each number
_FARTHER = (0.1, 0.3, 0.05, 0.2)  # how far they reach in turn, share of the radius [1]
_COMPARED = 64  # likely patches that the exact law chooses from
_NORMAL_95 = 1.96  # of a normal distribution, 95 % [std]
_CHANGE_95 = 0.5 * 3.84  # difference of ln likelihood, 95 % of a chi square of one number
_JUMP_95 = 0.5 * 7.35  # the same of a likelihood that has jumps (Hansen 2000)


def settled(
    explanation: Explanation, candidate: Candidate
) -> tuple[list[dict[str, float]], Extent]:
    """Inner numbers of a candidate that are likely next to all others, the best ones first.

    Also their extent.
    """
    law = LAWS[candidate.name]
    if law.search is not None and law.search.placed:
        return _patch(explanation, candidate)
    if law.enters is Enters.LASTING:
        return _change(explanation, candidate)
    return [candidate.inner], {}


class _Gains:
    """Evidence that shares of the weight add to the rest of an explanation."""

    def __init__(self, explanation: Explanation, candidate: Candidate) -> None:
        fit = explanation.fit
        self.trace, self.onset = fit.trace, fit.onsets[explanation.at]
        rest = [c for c in fit.chosen if c.name != candidate.name]
        usable = [c.name != candidate.name for c in fit.chosen for _ in range(c.count)]
        columns = fit.extra.take(np.flatnonzero(usable).tolist())
        every, own, std = columns_at(self.trace, self.onset, columns)
        centre = np.concatenate([np.zeros(len(std)), *(np.full(c.count, c.centre) for c in rest)])
        std = np.concatenate([std, *(c.std for c in rest)])
        spread = self.trace.table.spread
        grams = Grams.of(every, own, spread)
        solutions = solved_both(grams, std, fit.noise, self.trace.calibrated, centre)
        self.best = max(solutions, key=lambda s: s.evidence)
        variance = prior.own_variance(fit.noise, own.shape[2])
        self.precision = Precision.of(own, spread, fit.noise[0], variance)
        self.weighed = self.precision.times(every)
        self.moment = Moment.of(self.trace.samples, self.onset, self.trace.quicker)

    def of(self, shares: Floats) -> Floats:
        """(Q,) tempered gains of shares (S, M, Q) that brakes bring."""
        trace, table = self.trace, self.trace.table
        columns = Integrated.of(table, shares, np.ones(shares.shape[2], bool))
        added = -columns.fallen(table, self.onset, self.moment)
        cross = products(added, self.weighed)
        shared, pull = cross[:, :-1], cross[:, -1] - cross[:, :-1] @ self.best.mean
        taken = np.einsum("qp,qp->q", shared @ self.best.covariance, shared)
        middle = np.einsum("smq,sm->q", shares, trace.used) / trace.used.sum()
        precision = np.square(size_of(shares - middle, trace.used) / (prior.SLAB * trace.force))
        inner = self.precision.squares(added) - taken + np.maximum(precision, 1e-12)
        gain: Floats = pull**2 / inner - np.log(inner / np.maximum(precision, 1e-12))
        return 0.5 * prior.TEMPER * gain


def _patch(explanation: Explanation, candidate: Candidate) -> tuple[list[dict[str, float]], Extent]:
    gains = _Gains(explanation, candidate)
    table, rng = gains.trace.table, np.random.default_rng(0)
    names = ("x", "y", "radius")
    tried = np.array([[at[name] for name in names] for at, _ in circles(table)])
    tried = np.concatenate((tried, [[candidate.inner[name] for name in names]]))
    gain = gains.of(np.stack([share_inside(table.x, table.y, *c) for c in tried], axis=2))
    for turn in range(len(_REACHES) + _ROUNDS):
        if turn < len(_REACHES):
            start, reach = tried[np.argmax(gain)], _REACHES[turn]
        else:  # from where the region reaches farthest, to each side in turn
            likely = tried[gain > gain.max() - _JUMP_95]
            along, side = likely[:, turn % 3], 1.0 if turn % 2 else -1.0
            start, reach = likely[np.argmax(side * along)], _FARTHER[turn % len(_FARTHER)]
        steps = reach * rng.standard_normal((_TRIED, 3))
        near = start + steps * start[2]
        near[:, 2] = start[2] * np.exp(steps[:, 2])
        each = [share_inside(table.x, table.y, *c) for c in near]
        held = [holds_stops(inside) for inside in each]
        if any(held):
            shares = np.stack(
                [inside for inside, usable in zip(each, held, strict=True) if usable], 2
            )
            tried = np.concatenate((tried, near[held]))
            gain = np.append(gain, gains.of(shares))
    order = np.argsort(-gain)
    likely = tried[order[gain[order] > gain.max() - _JUMP_95]]
    off = np.abs(likely - likely[0]).max(axis=0)
    extent = {name: float(std) for name, std in zip(names, off / _NORMAL_95, strict=True)}
    spaced = likely[:: max(len(likely) // _COMPARED, 1)]
    return [dict(zip(names, circle.tolist(), strict=True)) for circle in spaced], extent


def _change(
    explanation: Explanation, candidate: Candidate
) -> tuple[list[dict[str, float]], Extent]:
    gains, search = _Gains(explanation, candidate), LAWS[candidate.name].search
    assert search is not None
    seen = stops_seen(gains.trace.table, Hypothesis.configured(gains.trace.model))
    runs = [(inner, share) for inner, share in search.columns(seen)]
    gain = gains.of(np.stack([share for _, share in runs], axis=2))
    best = runs[int(np.argmax(gain))][0]
    likely = [runs[i][0]["run"] for i in np.flatnonzero(gain > gain.max() - _CHANGE_95)]
    # A change between two runs is known to no better than one run.
    return [best], {"run": (0.5 * (max(likely) - min(likely)) + 0.5) / _NORMAL_95}
