"""From the weights of all explanations to one word, and what the model becomes by it.

A certain effect that changes no stop by a length that matters is not named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.answer import Answer
from slopewise.models.discrepancy.likelihood.refit import Refit, refitted
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis, mainly_along
from slopewise.models.discrepancy.likelihood.resolvable import CHANGED_STOPS, Resolvable
from slopewise.models.discrepancy.likelihood.weigh import LAG
from slopewise.models.discrepancy.settings import DiscrepancySettings


@dataclass(frozen=True, slots=True)
class Decision:
    """Conclusion that the log supports.

    Attributes:
        verdict: one word. explanation: effects and coefficients that go with it.
        alternatives: explanations that the log does not rule out next to the names.
        confidence: one for each added effect, in their order.
        axis: that an unknown follows. absorbed: for `unidentifiable`. notes: warnings.
        unchanged: the model stays as configured.
        named: which of the explanation's effects are named; others are fitted along.
    """

    verdict: Verdict
    explanation: Refit
    alternatives: tuple[Refit, ...] = ()
    confidence: tuple[float, ...] = ()
    axis: ResidualAxis | None = None
    absorbed: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    unchanged: bool = False
    named: tuple[int, ...] = ()

    @property
    def keeps_model(self) -> bool:
        """The model that is written is the one that was configured."""
        return self.unchanged or self.verdict in (Verdict.NONE, Verdict.TOO_NOISY)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects that are named."""
        return tuple(self.explanation.hypothesis.added[i].name for i in self.named)


def decide(
    table: StopTable,
    plain: Refit,
    answer: Answer,
    located: list[ResidualAxis],
    seen: Resolvable,
    settings: DiscrepancySettings,
) -> Decision:
    """One word for the log."""
    nothing = Decision(Verdict.NONE, plain)
    if answer.verdict is Verdict.NONE and _too_noisy(table, seen, settings):
        return replace(nothing, verdict=Verdict.TOO_NOISY)
    # A wind along the only heading is a change of coefficients, one across it is not.
    is_hidden = any(c.first in seen.hidden for c in answer.leader.fit.chosen if c.named)
    match answer.verdict:
        case Verdict.MISSING_EFFECT if is_hidden:
            return nothing
        case Verdict.MISSING_EFFECT | Verdict.AMBIGUOUS if answer.leader.names:
            return _named(table, answer, nothing, settings)
        case Verdict.UNKNOWN:
            return replace(nothing, verdict=Verdict.UNKNOWN, axis=_followed(located, answer.axis))
        case _:
            return nothing


def _followed(located: list[ResidualAxis], axis: str) -> ResidualAxis | None:
    """The axis of the likeliest explanation, unless stops follow another one and not that."""
    along = next((f for f in located if f.axis.name == axis), None)
    if along is not None and along.p_value < prior.RULED_OUT:
        return along
    return mainly_along(located) or along


def drifted(nothing: Decision, seen: Resolvable) -> Decision:
    """New coefficients, or a cause that they hide."""
    verdict = Verdict.UNIDENTIFIABLE if seen.absorbed else Verdict.PARAMETER_DRIFT
    return replace(nothing, verdict=verdict, absorbed=seen.absorbed)


def practical_lengths(distance: Floats, settings: DiscrepancySettings) -> Floats:
    """(S,) change of each stop from which one matters [m]."""
    return np.maximum(settings.practical_share * distance, settings.practical_length) + 1e-9


def _too_noisy(table: StopTable, seen: Resolvable, settings: DiscrepancySettings) -> bool:
    """Half of all effects would have to change stops too much to be seen."""
    return seen.by_noise > settings.noisy_share * float(np.median(table.distance))


def _named(
    table: StopTable, answer: Answer, nothing: Decision, settings: DiscrepancySettings
) -> Decision:
    fit = refitted(answer.leader)
    added = fit.hypothesis.added
    ends, min_change = distances(table, fit.hypothesis), practical_lengths(table.distance, settings)
    named, small = [], []
    for i, effect in enumerate(added):
        if effect.name == LAG and LAG not in answer.leader.names:
            continue  # the short build-up that all brakes have
        rest = replace(fit.hypothesis, added=(*added[:i], *added[i + 1 :]))
        change = np.abs(ends - distances(table, rest))
        if effect.name == LAG or np.sort(change / min_change)[-CHANGED_STOPS] >= 1.0:
            named.append(i)
            continue
        length = 1e3 * float(np.sort(change)[-CHANGED_STOPS])
        small.append(
            f"{effect.name} was seen and changes stops by no more than {length:.0f} mm: "
            "too small to be named"
        )
    if not named:
        return replace(nothing, notes=tuple(small))
    plain = nothing.explanation
    alternatives = tuple(refitted(e) if e.names else plain for e in answer.alternatives)
    if answer.verdict is Verdict.AMBIGUOUS:
        alternatives = alternatives or (plain,)
    return replace(
        nothing,
        verdict=answer.verdict,
        explanation=fit,
        alternatives=alternatives,
        confidence=tuple(answer.of_names.get(e.name, 0.0) for e in added),
        notes=tuple(small),
        named=tuple(named),
    )
