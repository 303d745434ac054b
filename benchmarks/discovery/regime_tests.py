"""Where a model is wrong, by exact tests in regimes: LISDD's idea on the stops of a log.

After Wang, Where Is My Physics Wrong? Localized and Identifiable Discovery of Model Discrepancy,
arXiv 2606.23215 (2026), as far as its abstract tells: the known physics is fitted in a clean regime
that is detected automatically; regimes whose residual energy is too large are flagged; in each the
missing term is chosen by exhaustive holdout over a library, and confirmed by an F-test on samples
that had no part in the choice, with the false discovery rate controlled over regimes.

What the abstract leaves open, and is ours therefore: regimes are thirds of what stops differ in,
four headings, nine places and all stops together; samples are the bins of stops, made independent
by the covariance fitted with the base (:mod:`.peer_base`), which the F-tests take as known up to a
factor; a build-up of the brakes, which acts in all stops alike, is fitted with the base; every
second stop confirms what the others choose; residual energy is compared by Chow's test of
predictions (1960); inner numbers of a term are chosen along with it; the answer is the one term
that is most significant, if what it changes is of a practical size.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from .gls_scan import MOTION, gains, left_by, over_practical
from .peer_base import BASE, BaseFit, fit_base, likeliest, whitened
from .peer_regressors import Candidate, candidates, heat
from .peer_traces import BINS
from .physics import Floats
from .regime_rows import Mask, Rows, adjusted, energy_p_value, term_p_value
from .sensing import Columns

RATE = 0.05
"""Share of false discoveries."""

_BUILD_UP = "brake_lag"
_BEYOND_DOUBT = 1e-15  # p value
_PARTS = 3  # of each variable
_LEAST = 6  # stops in a regime
_COOLING = 110.0  # [s] of the heat that stops are alike in
_REMOVED = 6  # regimes that are taken out of the clean one at most


class Discovery(NamedTuple):
    """A term in a regime: who it is, in which stops, p value on stops that did not choose it."""

    candidate: Candidate
    inside: Mask
    p_value: float


def name_effects(columns: Columns, configured: dict[str, float]) -> tuple[str, ...]:
    """The most significant term as a name of the library; none if nothing is confirmed."""
    plain = fit_base(columns, configured)
    found, build_up = with_build_up(plain)
    tried = [(plain, build_up), *((found, one) for one in discoveries(found))]
    confirmed = [one for base, one in tried if one.p_value <= RATE and _matters(base, one)]
    confirmed.sort(key=lambda one: one.p_value)
    return tuple(one.candidate.name for one in confirmed[:1])


def with_build_up(found: BaseFit) -> tuple[BaseFit, Discovery]:
    """The base with the build-up of the brakes that suits best, and that as a discovery."""
    lags = [one for one in candidates(found) if one.name == _BUILD_UP]
    best = lags[int(np.argmax(gains(found, found.base, lags)))]
    base = np.concatenate((found.base, best.columns), axis=2)
    every, wanted = whitened(found, base, found.scatter)
    stops = np.arange(len(found.lost))
    rows = Rows(every[:, :BASE], wanted, np.repeat(stops, BINS))
    everywhere = np.ones(len(stops), bool)
    p_value = term_p_value(rows, every[:, BASE:], stops % 2 == 1, everywhere)
    widened = found._replace(base=base, **likeliest(found, base)._asdict())
    return widened, Discovery(best, everywhere, p_value)


def discoveries(found: BaseFit, rate: float = RATE) -> list[Discovery]:
    """Terms that hold in their regimes, at this rate of false discoveries."""
    library = [one for one in candidates(found) if one.name != _BUILD_UP]
    stops, known = np.arange(len(found.lost)), found.base.shape[2]
    widths = np.cumsum([0, known, *(one.columns.shape[2] for one in library)])
    stacked = np.concatenate([found.base, *(one.columns for one in library)], axis=2)
    every, wanted = whitened(found, stacked, found.scatter)
    rows = Rows(every[:, :known], wanted, np.repeat(stops, BINS))
    terms = [every[:, a:b] for a, b in itertools.pairwise(widths[1:])]
    choosing, places = stops % 2 == 0, regimes(found)
    clean = _clean(rows, places, choosing, rate)
    energies = [energy_p_value(rows, choosing & clean & ~one, choosing & one) for one in places]
    flagged = [one for one, p in zip(places, adjusted(energies), strict=True) if p <= rate]
    tried = []
    for inside in [*flagged, np.ones(len(stops), bool)]:
        used = clean | inside
        best = _chosen(rows, terms, library, choosing & used, inside)
        p_value = term_p_value(rows, terms[best], ~choosing & used, inside)
        tried.append(Discovery(library[best], inside, p_value))
    passed = adjusted([one.p_value for one in tried])
    return [one for one, p in zip(tried, passed, strict=True) if p <= rate]


def regimes(found: BaseFit) -> list[Mask]:
    """(n,) masks of stops that are alike in one thing, six at least in each."""
    t = found.traces
    braking = (t.weight > 0.0) / np.maximum(np.sum(t.weight > 0.0, axis=1, keepdims=True), 1)
    grade, roll, turn = (np.sum(one * braking, axis=1) for one in (t.grade, t.roll, t.turn))
    alike = [
        t.v_i,
        grade,
        np.abs(grade),
        np.abs(roll),
        np.abs(turn),
        t.clock[:, 0],
        heat(found, _COOLING)[:, 0],
    ]
    masks = [one for values in alike for one in _thirds(values)]
    quarter = np.floor(np.mod(t.yaw[:, 0], 2.0 * np.pi) / (0.5 * np.pi))
    masks += [quarter == k for k in range(4)]
    masks += [a & b for a in _thirds(t.x[:, 0]) for b in _thirds(t.y[:, 0])]
    return [one for one in masks if np.sum(one) >= _LEAST]


def _thirds(values: Floats) -> list[Mask]:
    if np.ptp(values) == 0.0:
        return []
    which = np.searchsorted(np.quantile(values, np.arange(1, _PARTS) / _PARTS), values)
    return [which == k for k in range(_PARTS)]


def _clean(rows: Rows, places: list[Mask], choosing: Mask, rate: float) -> Mask:
    """(n,) stops outside the regimes that the others predict worst, half of all at least."""
    clean = np.ones(len(choosing), bool)
    for _ in range(_REMOVED):
        kept = [one for one in places if 2 * np.sum(clean & ~one) >= len(clean)]
        energies = [energy_p_value(rows, choosing & clean & ~one, choosing & one) for one in kept]
        worst = int(np.argmin(energies)) if energies else -1
        if worst < 0 or adjusted(energies)[worst] > rate:
            break
        clean &= ~kept[worst]
        places = [one for one in places if one is not kept[worst]]
    return clean


def _chosen(
    rows: Rows, terms: list[Floats], library: list[Candidate], stops: Mask, inside: Mask
) -> int:
    """Index of the term that predicts stops of the regime best, each half of it from the other."""
    folds = np.cumsum(stops & inside) % 2 == 0
    acting = inside[rows.stop][:, None]
    errors = np.zeros(len(terms))
    for fold in (folds, ~folds):
        held = (stops & inside & fold)[rows.stop]
        learned = stops[rows.stop] & ~held
        for i, term in enumerate(terms):
            x = np.concatenate((rows.base, term * acting), axis=1)
            gram = x[learned].T @ x[learned]
            gram[np.diag_indices_from(gram)] *= 1.0 + 1e-9
            best = np.linalg.solve(
                gram + 1e-12 * np.eye(len(gram)), x[learned].T @ rows.wanted[learned]
            )
            if library[i].positive and best[rows.base.shape[1]] < 0.0:
                errors[i] = np.inf
            errors[i] += float(np.sum((rows.wanted[held] - x[held] @ best) ** 2))
    return int(np.argmin(errors))


def _matters(found: BaseFit, one: Discovery) -> bool:
    """The term changes stops of its regime by a practical size.

    What the base can take up of it does not count, but for a term of motion beyond doubt.
    """
    acting = one.candidate.columns * one.inside[:, None, None]
    columns = np.concatenate((found.base, acting), axis=2)
    x, wanted = whitened(found, columns, found.scatter)
    changed = acting @ np.linalg.lstsq(x, wanted, rcond=None)[0][found.base.shape[2] :]
    if not (one.candidate.name in MOTION and one.p_value < _BEYOND_DOUBT):
        changed = left_by(found, found.base, changed)
    return over_practical(found, changed) >= 1.0
