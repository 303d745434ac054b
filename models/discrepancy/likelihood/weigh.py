"""From a table of stops to weighed explanations.

The search goes in rounds: scatter that an effect explains hides others, so everything is searched
again at the onset and the noise of the leader, until the leader stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from slopewise.models.arrays import Ints
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import (
    Dictionary,
    dictionary_of,
    spikes_of,
)
from slopewise.models.discrepancy.likelihood.fit import Fit, fit, quick_fit
from slopewise.models.discrepancy.likelihood.posterior import (
    Explanation,
    change_of_stops,
    explanations,
)
from slopewise.models.discrepancy.likelihood.search import searched
from slopewise.models.discrepancy.likelihood.trace import Trace, trace_of
from slopewise.models.parameters import Model

_TRIED = 8  # sets that each round fits
_ROUNDS = 4  # of the search: a fourth changed no leader
_CONVERGED = 3  # sets whose onsets are fitted to the end


@dataclass(frozen=True, slots=True)
class Weights:
    """Weights of all explanations of a log.

    Attributes:
        explanations: the heaviest first. change: root mean square change of stopping distances by
            new coefficients alone [1]. changed: probability of such, if nothing else is missing.
        book: columns of all that was tried.
    """

    explanations: tuple[Explanation, ...]
    change: float
    changed: float
    book: Dictionary


@dataclass(frozen=True, slots=True)
class _Weighed:
    """A fit, ln of its prior, and whether its onset is its own."""

    fit: Fit
    log_prior: float
    converged: bool = False

    @property
    def log_weight(self) -> float:
        """Tempered, at its best build-up."""
        return self.log_prior + prior.TEMPER * float(self.fit.evidence.max())


def weighed(
    table: StopTable,
    model: Model,
    session: Ints,
    odds: float = 1.0,
    advance: Callable[[float], None] = lambda share: None,
) -> Weights:
    """Weigh all explanations of a log.

    Args:
        table: S stops. model: as configured. session: (S,) number of each stop's session.
        odds: of causes before the log, over those of :mod:`.prior`.
        advance: receives the share that is done.
    """
    trace = trace_of(table, model, spikes_of(table, model), session)
    book = dictionary_of(table, model, trace.used, trace.force, odds)
    base = fit(trace, book, ())
    advance(0.3)
    nothing = frozenset[str]()
    known = {nothing: _Weighed(base, 0.0, converged=True)}
    leader = nothing
    for turn in range(_ROUNDS):
        at = known[leader].fit
        for match in searched(trace, book, at, at.best)[:_TRIED]:
            if match.names and match.names not in known:
                tried = quick_fit(trace, book, match.chosen, at)
                known[match.names] = _Weighed(tried, match.log_prior)
        before, leader = leader, max(known, key=lambda n: known[n].log_weight)
        if not known[leader].converged:
            known[leader] = _converged(trace, book, known[leader], at)
            leader = max(known, key=lambda n: known[n].log_weight)
        advance(1.0 - 0.7 * 0.5 ** (turn + 1))
        if leader == before:
            break
    ranked = sorted(known, key=lambda n: -known[n].log_weight)
    for names in {*ranked[:_CONVERGED], nothing} - {leader}:
        known[names] = _converged(trace, book, known[names], known[leader].fit)
    fits = [(w.fit, w.log_prior) for w in known.values()]
    every = explanations(fits, model.braking.dead_time, odds)
    advance(1.0)
    calm = known[nothing].fit
    solution = calm.solutions[calm.best]
    return Weights(tuple(every), change_of_stops(trace, calm), solution.changed, book)


def _converged(trace: Trace, book: Dictionary, explanation: _Weighed, near: Fit) -> _Weighed:
    """With a separate onset, from that of another explanation or from its present one."""
    again = fit(trace, book, explanation.fit.chosen, (near, explanation.fit))
    if explanation.converged and explanation.fit.evidence.max() >= again.evidence.max():
        return explanation
    return _Weighed(again, explanation.log_prior, converged=True)
