"""From the weights of all explanations to one word, and what the model becomes by it.

Weights are of a linear model; what is named is fitted again with the laws that the planner uses. An
effect that is surely there and changes no stop by a length that matters is not named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.size import ChangeOfStops, sizes_of
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.answer import Answer
from slopewise.models.discrepancy.likelihood.posterior import LAG, Explanation
from slopewise.models.discrepancy.model.hypothesis import builds_up, is_placed
from slopewise.models.discrepancy.search.absorbed import Absorbed, absorbed_explanations
from slopewise.models.discrepancy.search.candidates import EffectColumn, is_cap
from slopewise.models.discrepancy.search.locate import Followed, mainly_along
from slopewise.models.discrepancy.search.patches import moved_patch
from slopewise.models.discrepancy.search.refine import Fit, fit_either_way, fit_other_forms
from slopewise.models.discrepancy.search.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import ABSORBED_SHARE, WILD_SCATTER
from slopewise.models.parameters import Effect

_BEYOND_NOISE = 0.99  # probability of an answer that wild stops do not give by chance [1]


@dataclass(frozen=True, slots=True)
class FittedExplanation:
    """Effects that are believed together, fitted with their own laws."""

    fit: Fit

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of the alphabet."""
        return tuple(sorted(self.fit.hypothesis.names))


@dataclass(frozen=True, slots=True)
class Decision:
    """What the log allows to say.

    Attributes:
        verdict: one word. explanation: effects and coefficients that go with it.
        rivals: explanations that are nearly as good, for `ambiguous`.
        confidence: of each of the explanation's names, in their order.
        axis: that an unknown follows.
        absorbed: for `unidentifiable`.
        notes: doubts, in sentences.
        kept: the model stays as configured.
        sizes: of the explanation's effects, in their order. Those below a practical size are
            fitted along and not named.
        visible: change of a stop from which an effect would have been seen, by name [m].
    """

    verdict: Verdict
    explanation: FittedExplanation
    rivals: tuple[FittedExplanation, ...] = ()
    confidence: tuple[float, ...] = ()
    axis: Followed | None = None
    absorbed: tuple[Absorbed, ...] = ()
    notes: tuple[str, ...] = ()
    kept: bool = False
    sizes: tuple[ChangeOfStops, ...] = ()
    visible: Mapping[str, float] = field(default_factory=dict)

    @property
    def kept_as_it_was(self) -> bool:
        """The model that is written is the one that was configured."""
        return self.kept or self.verdict in (Verdict.NONE, Verdict.TOO_NOISY)

    @property
    def named(self) -> tuple[int, ...]:
        """Which of the explanation's effects are named."""
        return tuple(i for i, size in enumerate(self.sizes) if size.practical >= 1.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects that are named, in the order in which they were found."""
        return tuple(self.explanation.fit.hypothesis.added[i].name for i in self.named)


def decide(
    table: StopTable,
    plain: Fit,
    built: Fit,
    answer: Answer,
    located: list[Followed],
    seen: Resolvable,
    settings: DiscrepancySettings,
) -> Decision:
    """One word for the log.

    Args:
        table: stops. plain: refitted model, without any nuisance. built: with the build-up of the
            brakes. answer: what the weights say. located: axes that `built` disagrees along.
        seen: what could have been seen. settings: what matters.
    """
    nothing = Decision(Verdict.NONE, FittedExplanation(plain), visible=seen.visible)
    uncertain = answer.probability < _BEYOND_NOISE and _scatters_wildly(table, plain)
    if _too_noisy(table, seen, settings) and (answer.verdict is Verdict.NONE or uncertain):
        return replace(nothing, verdict=Verdict.TOO_NOISY)
    match answer.verdict:
        case Verdict.MISSING_EFFECT if _hidden(answer, seen):
            return drifted(table, nothing, seen)
        case Verdict.MISSING_EFFECT | Verdict.AMBIGUOUS if answer.leader.names:
            return _named(table, built, answer, nothing, settings)
        case Verdict.UNKNOWN:
            along = next((f for f in located if f.axis.name == answer.axis), None)
            return replace(nothing, verdict=Verdict.UNKNOWN, axis=along or mainly_along(located))
        case Verdict.PARAMETER_DRIFT:
            return drifted(table, nothing, seen)
        case _:
            return nothing


def _scatters_wildly(table: StopTable, plain: Fit) -> bool:
    """Stops differ so much among themselves that a name is one of many that chance could give."""
    return plain.noise.scatter > WILD_SCATTER * max(float(np.median(table.force)), 1e-3)


def _hidden(answer: Answer, seen: Resolvable) -> bool:
    """New coefficients can do in this log whatever a named effect does."""
    return any(seen.absorbed.get(n, 0.0) >= ABSORBED_SHARE for n in answer.leader.names)


def drifted(table: StopTable, nothing: Decision, seen: Resolvable) -> Decision:
    """New coefficients, or a cause that they hide."""
    absorbed = absorbed_explanations(table, nothing.explanation.fit, seen.absorbed)
    verdict = Verdict.UNIDENTIFIABLE if absorbed else Verdict.PARAMETER_DRIFT
    return replace(nothing, verdict=verdict, absorbed=absorbed)


def _too_noisy(table: StopTable, seen: Resolvable, settings: DiscrepancySettings) -> bool:
    """Half of all effects would have to change stops too much to be seen."""
    least = settings.noisy_share * float(np.median(table.distance))
    sizes = list(seen.visible.values())
    return bool(sizes) and float(np.median(sizes)) > least


def _named(
    table: StopTable,
    built: Fit,
    answer: Answer,
    nothing: Decision,
    settings: DiscrepancySettings,
) -> Decision:
    fit = fitted(table, built, answer.leader)
    added = fit.hypothesis.added
    sizes = tuple(
        replace(size, practical=float(_is_lag(effect, answer))) if builds_up(effect) else size
        for effect, size in zip(added, sizes_of(table, fit, settings), strict=True)
    )
    small = tuple(
        f"{effect.name} was seen and changes stops by no more than {1e3 * size.length:.0f} mm: "
        "too small to be named"
        for effect, size in zip(added, sizes, strict=True)
        if size.practical < 1.0 and not builds_up(effect)
    )
    if all(size.practical < 1.0 for size in sizes):
        return replace(nothing, notes=small)
    rivals: tuple[FittedExplanation, ...] = ()
    if answer.verdict is Verdict.AMBIGUOUS:
        rivals = tuple(FittedExplanation(fitted(table, built, r)) for r in answer.rivals)
        rivals = rivals or (nothing.explanation,)
    return replace(
        nothing,
        verdict=answer.verdict,
        explanation=FittedExplanation(fit),
        rivals=rivals,
        confidence=tuple(answer.of_names.get(e.name, 0.0) for e in added),
        notes=small,
        sizes=sizes,
    )


def _is_lag(effect: Effect, answer: Answer) -> bool:
    """Whether a build-up is a lag by the weights, and with its exact law as well."""
    return LAG in answer.leader.names and effect.parameters["tau"] > 0.5 * prior.LAG[0]


def fitted(table: StopTable, built: Fit, explanation: Explanation) -> Fit:
    """An explanation with the laws of its effects, from where its linear model left it.

    Args:
        table: stops. built: refitted model with the build-up of the brakes.
        explanation: its named effects are fitted, causes without a name are not.
    """
    hypothesis = built.hypothesis
    onset = explanation.fit.onsets[explanation.at]
    if LAG in explanation.names and not any(map(builds_up, hypothesis.added)):
        lag = Effect(name=LAG, parameters={"tau": onset.build_up})
        hypothesis = replace(hypothesis, dead_time=max(onset.dead_time, 0.0)).plus(lag)
    mean = explanation.fit.solutions[explanation.at].mean
    at = len(mean) - sum(c.count for c in explanation.fit.chosen)
    for candidate in explanation.fit.chosen:
        if candidate.named:
            column = EffectColumn(candidate.name, candidate.inner)
            hypothesis = hypothesis.plus(column.effect(float(mean[at])))
        at += candidate.count
    found = fit_either_way(table, hypothesis, replace(built.noise, capped=True))
    for index, effect in enumerate(found.hypothesis.added):
        if is_placed(effect):
            found = moved_patch(table, found, index)
    caps = any(is_placed(e) or is_cap(e.name) for e in found.hypothesis.added)
    return fit_other_forms(table, found) if caps else found
