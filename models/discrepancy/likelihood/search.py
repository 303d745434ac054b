"""Search over sets of explanations, in closed form at one onset; leaders are refitted later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, logsumexp

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate, Dictionary, prior_of
from slopewise.models.discrepancy.likelihood.fit import Fit
from slopewise.models.discrepancy.likelihood.gaussian import Solved
from slopewise.models.discrepancy.likelihood.marginal import mixed, solved_both
from slopewise.models.discrepancy.likelihood.trace import Trace, grams_at

_DEPTH, WIDTH = 2, 6
"""Effects in a set, and sets that are continued and fitted: a third one is mostly spurious."""


@dataclass(frozen=True, slots=True)
class EffectSet:
    """A set of explanations, with ln of its weight at the onset of the base.

    Attributes:
        chosen: the best candidate of each name. each: evidence of the chosen ones with
            coefficients as calibrated, and changed.
        log_prior: what grids, signs and priors add to the tempered evidence.
    """

    chosen: tuple[Candidate, ...]
    each: tuple[float, float]
    log_prior: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names in it, in order; that of an effect in two places twice."""
        return tuple(sorted(c.name for c in self.chosen))

    @property
    def log_weight(self) -> float:
        """Of all of its grids."""
        weight: float = self.log_prior + prior.TEMPER * mixed(*self.each)
        return weight


def searched(trace: Trace, book: Dictionary, fit: Fit, at: int) -> list[EffectSet]:
    """Sets worth refitting, the heaviest first; the empty one is among them."""
    grams, std = grams_at(trace, fit.onsets[at], book.columns)
    solutions = solved_both(grams, std, fit.noise, trace.calibrated)
    nothing = EffectSet((), (solutions[0].evidence, solutions[1].evidence), 0.0)
    best: dict[tuple[str, ...], EffectSet] = {}
    beam = [nothing]
    for depth in range(_DEPTH):
        for grown in [n for f in beam for n in _grown(f, book, solutions)]:
            if grown.names not in best or grown.log_weight > best[grown.names].log_weight:
                best[grown.names] = grown
        deep = [f for names, f in best.items() if len(names) == depth + 1]
        beam = sorted(deep, key=lambda f: -f.log_weight)[:WIDTH]
    return sorted((nothing, *best.values()), key=lambda f: -f.log_weight)


def _grown(start: EffectSet, book: Dictionary, base: tuple[Solved, Solved]) -> list[EffectSet]:
    """With one more name, the best column of each, grids summed."""
    left = (conditioned(b.left, b.pull, start.chosen) for b in base)
    (gain, sign), (changed_gain, changed_sign) = (gains_of(*x, book.candidates) for x in left)
    each = start.each[0] + gain, start.each[1] + changed_gain
    tempered = prior.TEMPER * mixed(*each)
    log_weight = np.where(changed_gain > gain, changed_sign, sign) + tempered
    log_weight += [c.log_prior for c in book.candidates]
    grown = []
    for group in book.groups:
        if all(book.candidates[group.start].can_join(c) for c in start.chosen):
            i = group.start + int(np.argmax(log_weight[group]))
            log_prior = start.log_prior + float(logsumexp(log_weight[group]) - tempered[i])
            evidence = float(each[0][i]), float(each[1][i])
            grown.append(EffectSet((*start.chosen, book.candidates[i]), evidence, log_prior))
    return grown


def gains_of(left: Floats, pull: Floats, every: Sequence[Candidate]) -> tuple[Floats, Floats]:
    """(C,) logarithms of the factors of the marginal likelihood by candidates and by their signs.

    Args:
        left: (Q, Q) precision of all columns. pull: (Q,) right-hand side. every: C candidates.
    """
    gain, sign = np.zeros((2, len(every)))
    counts = np.array([c.count for c in every])
    for count in np.unique(counts):
        places = np.flatnonzero(counts == count).tolist()
        chosen = [every[i] for i in places]
        index = np.array([c.first for c in chosen])[:, None] + np.arange(count)
        std = np.array([c.std for c in chosen])
        centre = np.array([c.centre for c in chosen])[:, None]
        block = left[index[:, :, None], index[:, None, :]]
        inner = block + np.eye(count) / std[:, None, :] ** 2
        side = pull[index] + centre / std**2
        mean = np.linalg.solve(inner, side[:, :, None])[:, :, 0]
        gain[places] = 0.5 * np.sum(side * mean - (centre / std) ** 2, axis=1)
        gain[places] -= 0.5 * np.linalg.slogdet(inner)[1] + np.log(std).sum(axis=1)
        if count == 1:
            one_sided = np.array([c.one_sided for c in chosen])
            positive = log_ndtr(mean * np.sqrt(inner[:, :, 0])) - log_ndtr(centre / std)
            sign[places] = np.where(one_sided, positive[:, 0], 0.0)
    return gain, sign


def conditioned(left: Floats, pull: Floats, chosen: Sequence[Candidate]) -> tuple[Floats, Floats]:
    """Precision and right-hand side of all columns once the chosen ones are fitted."""
    if not chosen:
        return left, pull
    index = [i for c in chosen for i in c.index]
    std, middle = prior_of(chosen)
    inner = left[np.ix_(index, index)] + np.diag(1.0 / std**2)
    mean = np.linalg.solve(inner, pull[index] + middle / std**2)
    cross = left[:, index]
    return left - cross @ np.linalg.solve(inner, cross.T), pull - cross @ mean
