"""Search over sets of explanations, in closed form at one onset; leaders are refitted later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, logsumexp

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate, Dictionary
from slopewise.models.discrepancy.likelihood.fit import Fit, mixed, solved_both
from slopewise.models.discrepancy.likelihood.gaussian import Solved
from slopewise.models.discrepancy.likelihood.trace import Trace, grams_at

_DEPTH, _WIDTH = 3, 6
"""Effects in a set, and sets that are continued: more changed nothing on simulated worlds."""


@dataclass(frozen=True, slots=True)
class Found:
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
    def names(self) -> frozenset[str]:
        """Names in it."""
        return frozenset(c.name for c in self.chosen)

    @property
    def log_weight(self) -> float:
        """Of all of its grids."""
        return self.log_prior + prior.TEMPER * mixed(*self.each)


def searched(trace: Trace, book: Dictionary, fit: Fit, at: int) -> list[Found]:
    """Sets worth refitting, the heaviest first; the empty one is among them."""
    grams, std = grams_at(trace, fit.onsets[at], book.columns)
    both = solved_both(grams, std, fit.noise, trace.force)
    nothing = Found((), (both[0].evidence, both[1].evidence), 0.0)
    found: dict[frozenset[str], Found] = {}
    beam = [nothing]
    for depth in range(_DEPTH):
        for grown in [n for f in beam for n in _grown(f, book.candidates, both, depth)]:
            if grown.names not in found or grown.log_weight > found[grown.names].log_weight:
                found[grown.names] = grown
        deep = [f for names, f in found.items() if len(names) == depth + 1]
        beam = sorted(deep, key=lambda f: -f.log_weight)[:_WIDTH]
    return sorted((nothing, *found.values()), key=lambda f: -f.log_weight)


def _grown(
    found: Found, every: Sequence[Candidate], both: tuple[Solved, Solved], depth: int
) -> list[Found]:
    """With one more name, the best column of each, grids summed."""
    rests = [conditioned(base.left, base.pull, found.chosen)[:2] for base in both]
    tried: dict[str, list[tuple[float, tuple[float, float], Candidate]]] = {}
    for c in every:
        if c.name in found.names:
            continue
        gains = [gain_of(*rest, c) for rest in rests]
        each = (found.each[0] + gains[0][0], found.each[1] + gains[1][0])
        sign = max(gains, key=lambda g: g[0])[1]
        own = c.log_prior + sign + prior.TEMPER * mixed(*each)
        tried.setdefault(c.name + ("" if c.named else "?"), []).append((own, each, c))
    price = np.log(prior.FURTHER) if depth else 0.0
    grown = []
    for grid in tried.values():
        weight = float(logsumexp([t[0] for t in grid]))
        _, each, best = max(grid, key=lambda t: t[0])
        log_prior = found.log_prior + price + weight - prior.TEMPER * mixed(*each)
        grown.append(Found((*found.chosen, best), each, log_prior))
    return grown


def gain_of(left: Floats, pull: Floats, c: Candidate) -> tuple[float, float]:
    """Logarithms of the factors of the marginal likelihood by a candidate and by its sign."""
    if c.count == 1:
        i, d, m = c.first, float(c.std[0]), c.centre
        s, b = max(float(left[i, i]), 1e-12), float(pull[i])
        b -= s * m
        inner = s + 1.0 / d**2
        gain = m * float(pull[i]) - 0.5 * m * m * s + 0.5 * b * b / inner
        gain -= 0.5 * np.log(inner * d * d)
        if not c.one_sided:
            return gain, 0.0
        mean = m + b / inner
        return gain, float(log_ndtr(mean * np.sqrt(inner)) - log_ndtr(m / d))
    index = c.index
    side = pull[index]
    block = left[np.ix_(index, index)] + np.diag(1.0 / c.std**2)
    gain = 0.5 * float(side @ np.linalg.solve(block, side))
    return gain - 0.5 * float(np.linalg.slogdet(block)[1]) - float(np.log(c.std).sum()), 0.0


def conditioned(
    left: Floats, pull: Floats, chosen: Sequence[Candidate]
) -> tuple[Floats, Floats, Floats]:
    """Precision and right-hand side of all columns once the chosen ones are fitted; their means."""
    if not chosen:
        return left, pull, np.empty(0)
    index = [i for c in chosen for i in c.index]
    std = np.concatenate([c.std for c in chosen])
    middle = np.concatenate([np.full(c.count, c.centre) for c in chosen])
    inner = left[np.ix_(index, index)] + np.diag(1.0 / std**2)
    mean = np.linalg.solve(inner, pull[index] + middle / std**2)
    cross = left[:, index]
    return left - cross @ np.linalg.solve(inner, cross.T), pull - cross @ mean, mean
