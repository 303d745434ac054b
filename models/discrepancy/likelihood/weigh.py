"""From a table of stops to weighed explanations.

The search goes in rounds: scatter that an effect explains hides others, so everything is searched
again at the onset and the noise of the leader, at most the usual one, until the leader stays. All
are then compared at one onset, and every set has two weights, with and without a lag.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Dictionary, dictionary_of, spikes_of
from slopewise.models.discrepancy.likelihood.fit import HOPELESS, Fit, fit, quick_fit
from slopewise.models.discrepancy.likelihood.place import placed
from slopewise.models.discrepancy.likelihood.search import WIDTH, EffectSet, searched
from slopewise.models.discrepancy.likelihood.trace import trace_of
from slopewise.models.discrepancy.model.hypothesis import MAX_STEPS, is_placed
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Model

_LEADERS = 3  # sets that are followed to the end, with a separate onset
LAG = next(name for name, law in LAWS.items() if law.enters is Enters.LAG)
"""Name of the effect that is an onset, not a column."""
_POINTS = 120  # points of the integral over ln τ


@dataclass(frozen=True, slots=True)
class Explanation:
    """One answer.

    Attributes:
        names: of effects. axes: causes without a name.
        log_weight: ln of its weight. fit, at: and the build-up it holds at.
    """

    names: frozenset[str]
    axes: frozenset[str]
    log_weight: float
    fit: Fit
    at: int


def weighed(
    table: StopTable,
    model: Model,
    odds: float = 1.0,
    advance: Callable[[float], None] = lambda share: None,
) -> tuple[list[Explanation], Dictionary]:
    """All explanations of a log, the heaviest first, and columns of all that was tried.

    Args:
        table: S stops. model: as configured.
        odds: of causes before the log, over those of :mod:`.prior`.
        advance: receives the share that is done.
    """
    trace = trace_of(table, model, spikes_of(table, model))
    book = dictionary_of(table, model, trace.used, trace.force, odds)
    nothing: tuple[str, ...] = ()
    known = {nothing: fit(trace, book, ())}
    advance(0.3)
    leader = nothing
    for turn in range(MAX_STEPS):
        at = known[leader]
        # What is missing is taken for scatter, which hides it: searched at usual scatter.
        quiet = replace(at, noise=np.minimum(at.noise, prior.NOISE))
        book = _with_places(book, quiet)
        matches = searched(trace, book, quiet, at.best)[:WIDTH]
        _try(known, matches, book, at)
        before, leader = leader, max(known, key=lambda n: known[n].log_weight)
        if not known[leader].settled:
            known[leader] = _settled(book, known[leader], at)
            leader = max(known, key=lambda n: known[n].log_weight)
        advance(1.0 - 0.7 * 0.5 ** (turn + 1))
        if leader == before:
            break
    _at_one_onset(known, book)
    every = explanations(known.values(), odds)
    advance(1.0)
    return every, book


def _at_one_onset(known: dict[tuple[str, ...], Fit], book: Dictionary) -> None:
    """Fit all explanations from the best onset that any of them has found, until it stays.

    The evidence has several maxima over the onset: a better one that an explanation found alone
    would decide for it, and its effects would not.
    """
    compared: dict[tuple[str, ...], Fit] = {}
    for _ in range(MAX_STEPS):
        ranked = sorted(known, key=lambda n: -known[n].log_weight)
        near = known[ranked[0]]
        late = [names for names in ranked[1:] if compared.get(names) is not near]
        if not late:
            return
        for names in late:
            before = known[names]
            if before.settled or names in ranked[:_LEADERS] or not names:
                now = _settled(book, before, near)
            else:
                now = quick_fit(book, before.chosen, before.log_prior, near)
            compared[names] = near
            if now.log_weight > before.log_weight or now.settled > before.settled:
                known[names] = now


def _try(
    known: dict[tuple[str, ...], Fit], matches: Sequence[EffectSet], book: Dictionary, near: Fit
) -> None:
    """Add sets that are new, or heavier in another place."""
    for match in matches:
        same = known.get(match.names)
        if match.names and (same is None or _moved(match, same)):
            tried = quick_fit(book, match.chosen, match.log_prior, near)
            if same is None or tried.log_weight > same.log_weight:
                known[match.names] = tried


def _with_places(book: Dictionary, fit: Fit) -> Dictionary:
    """With the likeliest place of each effect that has one: instead of those of a fit, and next."""
    for candidates in [book.candidates[group] for group in book.groups]:
        if candidates[0].named and is_placed(candidates[0].name):
            same = [c for c in fit.chosen if c.name == candidates[0].name]
            for without in (same, []) if same else ([],):
                book = book.plus(fit.trace.table, *placed(fit, without, candidates))
    return book


def _moved(match: EffectSet, known: Fit) -> bool:
    """Whether an explanation has the same names and an effect in another place."""
    before = [c.inner for c in known.chosen]
    return any(c.inner not in before for c in match.chosen if "radius" in c.inner)


def _settled(book: Dictionary, known: Fit, near: Fit) -> Fit:
    """With a separate onset, from that of another explanation or from its present one."""
    return fit(known.trace, book, known.chosen, known.log_prior, (near, known))


def explanations(fits: Iterable[Fit], odds: float) -> list[Explanation]:
    """Answers of refitted sets; odds as for :func:`weighed`."""
    answers = []
    for known in fits:
        # A model has one lag: where there is one, what the onset lacks is dead time.
        has_lag = any(effect.name == LAG for effect in known.trace.model.effect)
        for lag in (False,) if has_lag else (False, True):
            log_prior = known.log_prior + (np.log(odds * prior.NAME) if lag else 0.0)
            weight, at = _over_build_up(known, lag=lag)
            names = frozenset(c.name for c in known.chosen if c.named) | ({LAG} if lag else set())
            axes = frozenset(c.name for c in known.chosen if not c.named)
            answers.append(Explanation(names, axes, log_prior + weight, known, at))
    return sorted(answers, key=lambda e: -e.log_weight)


def _over_build_up(fit: Fit, *, lag: bool) -> tuple[float, int]:
    """Logarithm of the integral over ln τ, and the index of its largest term."""
    log_tau = np.log([o.build_up for o in fit.onsets])
    fine = np.linspace(np.log(prior.SLOW[1]), np.log(prior.LAG[1]), _POINTS)
    density = prior.of_build_up(fine, lag=lag)
    lowest = float(fit.evidence.min()) - HOPELESS
    followed = np.interp(fine, log_tau, fit.evidence, left=lowest, right=lowest)
    terms = prior.TEMPER * followed + np.log(np.maximum(density, 1e-300))
    weight = float(logsumexp(terms) + np.log(fine[1] - fine[0]))
    return weight, int(np.argmin(np.abs(log_tau - fine[int(np.argmax(terms))])))
