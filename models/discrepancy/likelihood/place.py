"""Places and times of change, which have no derivative, and how well they are known.

The edge of a patch matters only where a stop crosses it, and the run of a change only between runs:
the likelihood is flat in between and jumps at the edges. Many are tried in addition to all other
effects of the explanation; the interval holds those that likelihood does not exclude (Wilks), as
the standard deviation of a normal distribution with the same 95 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import norm

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate, circles, prior_of
from slopewise.models.discrepancy.likelihood.fit import HOPELESS, Fit
from slopewise.models.discrepancy.likelihood.gaussian import Grams
from slopewise.models.discrepancy.likelihood.marginal import solved_both
from slopewise.models.discrepancy.likelihood.onset import Integrated, Moment
from slopewise.models.discrepancy.likelihood.trace import columns_at, spread_of
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, is_placed
from slopewise.models.discrepancy.model.prediction import stops_seen
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.surface_patch import holds_stops, share_inside

Extent = dict[str, float]
"""Standard deviations of such numbers, by name."""

_NUMBERS = ("x", "y", "radius")
_POPULATION, _GENERATIONS = 48, 12  # of circles: enough for three numbers from any seed
_FINEST = 0.01  # share of the field, or of the radii, that a place is known to at best [1]
_NORMAL = float(norm.isf(0.5 * prior.RULED_OUT))  # half of an interval [std]
_CHANGE = 0.5 * _NORMAL**2  # difference of ln likelihood at its ends
_JUMP = -float(np.log1p(-np.sqrt(1.0 - prior.RULED_OUT)))  # where it has jumps (Hansen 2000)


def settled(fit: Fit, at: int, candidate: Candidate) -> tuple[list[dict[str, float]], Extent]:
    """Inner numbers of a candidate that are likely next to all others, the best ones first.

    Also their extent.
    """
    if is_placed(candidate.name):
        return _patch(fit, at, candidate)
    if LAWS[candidate.name].enters is Enters.LASTING:
        return _change(fit, at, candidate)
    return [candidate.inner], {}


class _Gains:
    """Evidence that shares of the weight add to all effects of a fit but some."""

    def __init__(self, fit: Fit, at: int, without: Sequence[Candidate]) -> None:
        self.trace, self.onset, self.noise = fit.trace, fit.onsets[at], fit.noise
        left_out = {id(c) for c in without}
        rest = [c for c in fit.chosen if id(c) not in left_out]
        usable = [id(c) not in left_out for c in fit.chosen for _ in range(c.count)]
        columns = fit.extra.take(np.flatnonzero(usable).tolist())
        self.every, self.per_stop, std = columns_at(self.trace, self.onset, columns)
        rest_std, rest_centre = prior_of(rest)
        centre = np.concatenate([np.zeros(len(std)), rest_centre])
        std = np.concatenate([std, rest_std])
        grams = Grams.of(self.every, self.per_stop, self.trace.table.spread)
        solutions = solved_both(grams, std, self.noise, self.trace.calibrated, centre)
        self.best = max(solutions, key=lambda s: s.evidence)
        self.moment = Moment.of(self.trace.samples, self.onset)

    def of(self, shares: Floats) -> Floats:
        """(Q,) tempered gains of shares (S, M, Q) that brakes bring."""
        trace, table, count = self.trace, self.trace.table, shares.shape[2]
        columns = Integrated.of(table, shares, np.ones(count, bool))
        added = -columns.fallen(table, self.onset, self.moment)
        grams = Grams.of(np.concatenate([added, self.every], axis=2), self.per_stop, table.spread)
        variance = prior.own_variance(self.noise, self.per_stop.shape[2])
        weighed = grams.whitened(self.noise[0], variance)[0]
        cross = weighed[:count, count:]
        shared, pull = cross[:, :-1], cross[:, -1] - cross[:, :-1] @ self.best.mean
        taken = np.einsum("qp,qp->q", shared @ self.best.covariance, shared)
        precision = np.square(spread_of(shares, trace.used) / (prior.SLAB * trace.force))
        inner = np.diag(weighed)[:count] - taken + np.maximum(precision, 1e-12)
        gain: Floats = pull**2 / inner - np.log(inner / np.maximum(precision, 1e-12))
        return 0.5 * prior.TEMPER * gain

    def of_circles(self, circles: Floats) -> Floats:
        """(N,) of circles (N, 3): x, y and radius [m]; a loss where they hold too few stops."""
        table = self.trace.table
        shares = [share_inside(table.x, table.y, *circle) for circle in circles]
        held = np.array([holds_stops(inside) for inside in shares])
        gain = np.full(len(circles), -HOPELESS)
        if held.any():
            inside = [share for share, usable in zip(shares, held, strict=True) if usable]
            gain[held] = self.of(np.stack(inside, axis=2))
        return gain


def _climbed(gains: _Gains, circles: Floats) -> tuple[Floats, Floats]:
    """(N, 3) circles, those in addition that differential evolution of the best ones comes to.

    Also (N,) their gains. The likelihood of a place is flat, with jumps, and has many maxima.
    """
    gain = [gains.of_circles(circles)]
    tried = [circles]
    first = circles[np.argsort(-gain[0])[:_POPULATION]] * [1.0, 1.0, 0.0]
    first[:, 2] = np.log(circles[np.argsort(-gain[0])[:_POPULATION], 2])

    def loss(moved: Floats) -> Floats:
        tried.append(np.column_stack((moved[:2].T, np.exp(moved[2]))))
        gain.append(gains.of_circles(tried[-1]))
        return -gain[-1]

    low, high = first.min(axis=0), first.max(axis=0)
    pad = 0.5 * (high - low)
    differential_evolution(
        loss,
        np.column_stack((low - pad, high + pad)),
        init=first,
        maxiter=_GENERATIONS,
        tol=0.0,
        rng=0,
        polish=False,
        updating="deferred",
        vectorized=True,
    )
    return np.concatenate(tried), np.concatenate(gain)


def placed(
    fit: Fit, without: Sequence[Candidate], group: Sequence[Candidate]
) -> tuple[Candidate, Floats]:
    """The likeliest place between those of a grid, and (S, M, 1) its share.

    Its prior is that of the part of the field and of the radii where it is as likely.

    Args:
        fit: the explanation to which it is added, at usual noise: a patch that is missing is taken
            for scatter. without: candidates of it that it replaces. group: the grid.
    """
    gains = _Gains(fit, fit.best, without)
    grid = np.array([[c.inner[n] for n in _NUMBERS] for c in group])
    tried, gain = _climbed(gains, grid)
    best = int(np.argmax(gain))
    near = tried[gain > gain[best] - _CHANGE]
    near[:, 2], grid[:, 2] = np.log(near[:, 2]), np.log(grid[:, 2])
    std = np.abs(near - [*tried[best, :2], np.log(tried[best, 2])]).max(axis=0) / _NORMAL
    volume = np.log(np.sqrt(2.0 * np.pi) * std / np.ptp(grid, axis=0) + _FINEST).sum()
    table = fit.trace.table
    share = share_inside(table.x, table.y, *tried[best])[:, :, None]
    candidate = replace(
        group[0],
        std=prior.SLAB * fit.trace.force / spread_of(share, fit.trace.used),
        inner=dict(zip(_NUMBERS, tried[best].tolist(), strict=True)),
        log_prior=group[0].log_prior + min(float(volume) + np.log(len(group)), 0.0),
    )
    return candidate, share


def _patch(fit: Fit, at: int, candidate: Candidate) -> tuple[list[dict[str, float]], Extent]:
    gains = _Gains(fit, at, [candidate])
    start = [[candidate.inner[name] for name in _NUMBERS]]
    grid = [[at[name] for name in _NUMBERS] for at, _ in circles(fit.trace.table)]
    tried, max_gain = np.array(start + grid), -np.inf
    while True:  # from the best circles again, until nothing is gained: few are tried near the top
        tried, gain = _climbed(gains, tried)
        order = np.argsort(-gain)
        if gain.max() < max_gain + _CHANGE:
            break
        tried, max_gain = tried[order[:_POPULATION]], float(gain.max())
    likely = tried[order[gain[order] > gain.max() - _JUMP]]
    spread = np.abs(likely - likely[0]).max(axis=0)
    extent = {name: float(std) for name, std in zip(_NUMBERS, spread / _NORMAL, strict=True)}
    spaced = likely[:: max(len(likely) // _POPULATION, 1)]
    return [dict(zip(_NUMBERS, circle.tolist(), strict=True)) for circle in spaced], extent


def _change(fit: Fit, at: int, candidate: Candidate) -> tuple[list[dict[str, float]], Extent]:
    search = LAWS[candidate.name].search
    gains = _Gains(fit, at, [candidate])
    assert search is not None
    seen = stops_seen(gains.trace.table, Hypothesis.configured(gains.trace.model))
    runs = [(inner, share) for inner, share in search.columns(seen)]
    gain = gains.of(np.stack([share for _, share in runs], axis=2))
    best = runs[int(np.argmax(gain))][0]
    likely = [runs[i][0]["run"] for i in np.flatnonzero(gain > gain.max() - _CHANGE)]
    # A change between two runs is known to no better than one run.
    return [best], {"run": (0.5 * (max(likely) - min(likely)) + 0.5) / _NORMAL}
