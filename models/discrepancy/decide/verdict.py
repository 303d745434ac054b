"""From scores to one word, and how sure it is.

The order matters: what the model's own numbers explain is no effect; a name is given only where no
other name is near, nothing is left that follows an axis, and no number is at the end of what is
physically usual; else the log has shown that something is there, and no more.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.restraint import (
    along_one_axis,
    build_up_under_a_cap,
    plainer_one,
    told_apart,
    weak,
)
from slopewise.models.discrepancy.decide.second_look import weighed_again
from slopewise.models.discrepancy.decide.size import (
    ChangeOfStops,
    change_between,
    practical_lengths,
    sizes_of,
)
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, builds_up
from slopewise.models.discrepancy.search.absorbed import Absorbed, absorbed_explanations
from slopewise.models.discrepancy.search.identify import Identified, ScoredExplanation, holds
from slopewise.models.discrepancy.search.locate import WITHIN, Followed
from slopewise.models.discrepancy.search.refine import Fit, as_output, fit, fit_either_way, residual
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import (
    AT_BOUND,
    BELIEVED_NAMES,
    BELIEVED_SHARE,
    LEFT_SHARE,
    P_DRIFT,
    PLAIN_BUILD_UP,
    STABLE_SHARE,
)
from slopewise.models.effects.registry import LAWS


@dataclass(frozen=True, slots=True)
class Decision:
    """What the log allows to say.

    Attributes:
        verdict: one word. explanation: effects and coefficients that go with it.
        rivals: explanations that are nearly as good, for `ambiguous`.
        confidence: of each of the explanation's names, in their order.
        axis: that an unknown follows, or what is left beside the names.
        absorbed: for `unidentifiable`.
        notes: doubts, in sentences.
        kept: the model stays as configured.
        sizes: of the explanation's effects, in their order. Those below a practical size are
            fitted along and not named.
        visible: change of a stop from which an effect would have been seen, by name [m].
    """

    verdict: Verdict
    explanation: ScoredExplanation
    rivals: tuple[ScoredExplanation, ...] = ()
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
        return _mattering(self.sizes)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects that are named, in the order in which they were found."""
        return tuple(self.explanation.fit.hypothesis.added[i].name for i in self.named)


def decide(
    table: StopTable,
    plain: Fit,
    found: Identified,
    left: list[Followed],
    located: list[Followed],
    settings: DiscrepancySettings,
) -> Decision:
    """One word for the log.

    Args:
        table: stops. plain: refitted model, without any nuisance. found: outcome of the search.
        left: axes that its best explanation still disagrees along, the most telling first.
        located: axes that the refitted model disagrees along.
        settings: how sure to be.
    """
    sure = [f for f in left if f.p_value < settings.structure]
    large = _large(table, sure, settings)
    trace = _said_of(sure[0]) if sure and not large else ()
    nothing = replace(found, best=ScoredExplanation(plain, found.best.score))
    if not found.best.names:
        return _with_build_up_alone(table, found.best, nothing, large, trace, settings)
    # Where the model's own shape is a little wrong, likelihoods differ by that for no reason.
    doubt = max(settings.rival, BELIEVED_SHARE * sure[0].chi_square) if sure else settings.rival
    again = weighed_again(table, found, doubt)
    found = found if again is None else again
    best, others = found.best, found.others
    refitted = next((e for e in (best, *others) if not e.names), _far(plain))
    plainer = plainer_one(table, best, others, doubt if sure else 0.0, settings)
    if plainer is not None:
        others = (best, *(e for e in others if e.names != plainer.names))
        best = plainer
    if not best.names or weak(table, best, refitted, located):
        seen, told = (large, trace) if again else (_patterns(table, located, settings), ())
        return _with_build_up_alone(table, refitted, nothing, seen, told, settings)
    doubt = settings.rival if again else doubt  # a wrong shape is in the likelihoods then
    others = tuple(e for e in others if not _unusually_small(e))
    near = [
        e
        for e in others
        if e.names and e.score < best.score + doubt and not holds(e.names, best.names)
    ]
    if _unusually_small(best) and near:
        best = min(near, key=lambda e: e.score)
        others = tuple(e for e in others if e.names != best.names)
    sizes = sizes_of(table, best.fit, settings)
    small = _too_small(best, sizes)
    if all(size.practical < 1.0 for size in sizes):
        return _without_names(table, nothing, large, (*small, *trace), settings)
    doubted = _doubted(table, plain, best, sizes, others, left, located, settings)
    if doubted is not None:
        words, axis = doubted
        return Decision(Verdict.UNKNOWN, nothing.best, axis=axis, notes=(words, *small))
    said = _said_of(sure[0]) if sure else ()
    best, sizes = _without_the_small(table, best, sizes)
    made = Decision(
        Verdict.MISSING_EFFECT,
        best,
        axis=sure[0] if sure else None,
        notes=(*small, *said),
        sizes=sizes,
        visible=found.visible,
    )
    near = [e for e in others if e.score < best.score + doubt or not _leads(best, e, settings)]
    rivals = tuple(e for e in near if _is_rival(e, made))
    confidence = _confidences(best, found, sizes, settings)
    verdict = Verdict.AMBIGUOUS if rivals else Verdict.MISSING_EFFECT
    return replace(made, verdict=verdict, rivals=rivals, confidence=confidence)


def _mattering(sizes: Sequence[ChangeOfStops]) -> tuple[int, ...]:
    return tuple(i for i, size in enumerate(sizes) if size.practical >= 1.0)


def _patterns(
    table: StopTable, located: list[Followed], settings: DiscrepancySettings
) -> list[Followed]:
    """Axes along which the refitted model disagrees enough to matter."""
    return _large(table, [f for f in located if f.p_value < settings.structure], settings)


def _is_rival(other: ScoredExplanation, made: Decision) -> bool:
    """It names something, and neither all that a decision names nor a part of its explanation."""
    best = made.explanation.names
    mattering = Counter(name for name in made.names if name in best)
    names = other.names
    return bool(names) and not mattering <= Counter(names) and not holds(best, names)


def _without_the_small(
    table: StopTable, best: ScoredExplanation, sizes: Sequence[ChangeOfStops]
) -> tuple[ScoredExplanation, tuple[ChangeOfStops, ...]]:
    """An explanation that is left with what matters, and a build-up that the log shows plainly."""
    hypothesis = best.fit.hypothesis
    kept = [
        size.practical >= 1.0 or (builds_up(effect) and size.gain > PLAIN_BUILD_UP)
        for effect, size in zip(hypothesis.added, sizes, strict=True)
    ]
    if all(kept):
        return best, tuple(sizes)
    rest = replace(hypothesis, added=tuple(itertools.compress(hypothesis.added, kept)))
    fit = fit_either_way(as_output(table, best.fit), rest, best.fit.noise, rounds=1)
    return replace(best, fit=fit), tuple(itertools.compress(sizes, kept))


def _too_small(best: ScoredExplanation, sizes: Sequence[ChangeOfStops]) -> tuple[str, ...]:
    """What was seen and does not matter, in sentences."""
    return tuple(
        f"{name} was seen for certain and changes stops by no more than "
        f"{1000.0 * size.length:.0f} mm: too small to be named"
        for name, size in zip((e.name for e in best.fit.hypothesis.added), sizes, strict=True)
        if size.practical < 1.0
    )


def _doubted(
    table: StopTable,
    base: Fit,
    best: ScoredExplanation,
    sizes: Sequence[ChangeOfStops],
    others: tuple[ScoredExplanation, ...],
    left: list[Followed],
    located: list[Followed],
    settings: DiscrepancySettings,
) -> tuple[str, Followed | None] | None:
    """Why the names that fit best are not given, and the axis to look along; None if they are."""
    sure = [f for f in left if f.p_value < settings.structure]
    names, first = best.names, sure[0] if sure else None
    ends = _numbers_at_their_end(best)
    if ends:
        words = f"{' and '.join(names)} would explain it, with {ends} at the end of what is usual"
        return f"{words}: the cause is likely another one", first
    large = _large(table, sure, settings)
    if large and _matters(table, base, best, large[0]):
        words = f"{' and '.join(names)} came nearest, but left a pattern along "
        return words + large[0].axis.name, large[0]
    if first is not None and len(set(names)) > BELIEVED_NAMES:
        words = f"{', '.join(names)} together came nearest, and left a pattern along "
        return f"{words}{first.axis.name}: the cause is likely another one", first
    added = best.fit.hypothesis.added
    if both := build_up_under_a_cap([added[i].name for i in _mattering(sizes)]):
        words = f"{' and '.join(both)} together came nearest; "
        within = next((f for f in located if f.axis.name in WITHIN), None)
        return words + "a force that builds up in another way looks like both", within
    together = along_one_axis(table, best)
    if together and not told_apart(best, others, together, left):
        words = f"{' and '.join(together)} together imitate it; "
        along = next((f for f in located if f.p_value < settings.structure), None)
        return words + "two effects along one axis can be any shape", along
    return None


def _large(table: StopTable, sure: list[Followed], settings: DiscrepancySettings) -> list[Followed]:
    """Patterns that matter for the stopping distance.

    What follows time or speed within a stop follows all axes of that kind; the surest of them
    decides whether it matters.
    """
    within = [f for f in sure if f.axis.name in WITHIN]
    apart = within[:1] + [f for f in sure if f.axis.name not in WITHIN]
    least = float(np.mean(practical_lengths(table.distance, settings)))
    return sorted((f for f in apart if f.distance > least), key=lambda f: -f.strength)


def _said_of(left: Followed) -> tuple[str, ...]:
    millimetres = 1000.0 * left.distance
    return (f"a little is left that follows {left.axis.name}: {millimetres:.0f} mm of way a stop",)


def _far(base: Fit) -> ScoredExplanation:
    """The base where it fell so far behind that its score is not known any more."""
    return ScoredExplanation(base, float("inf"))


def _with_build_up_alone(
    table: StopTable,
    refitted: ScoredExplanation,
    nothing: Identified,
    large: list[Followed],
    notes: tuple[str, ...],
    settings: DiscrepancySettings,
) -> Decision:
    """Where no effect is believed: the build-up of the brakes, if that matters, else no name.

    Args:
        table: stops. refitted: coefficients, with the build-up if there is one.
        nothing: outcome of the search, with coefficients alone in the place of its best.
        large: patterns that are left. notes: so far. settings: how sure to be.
    """
    sizes = sizes_of(table, refitted.fit, settings)
    notes = (*_too_small(refitted, sizes), *notes)
    if large or not any(size.practical >= 1.0 for size in sizes):
        return _without_names(table, nothing, large, notes, settings)
    return Decision(
        Verdict.MISSING_EFFECT,
        refitted,
        notes=notes,
        sizes=sizes,
        visible=nothing.visible,
        confidence=_confidences(refitted, nothing, sizes, settings),
    )


def _without_names(
    table: StopTable,
    nothing: Identified,
    large: list[Followed],
    notes: tuple[str, ...],
    settings: DiscrepancySettings,
) -> Decision:
    if large:
        return Decision(Verdict.UNKNOWN, nothing.best, axis=large[0], notes=notes)
    base, seen = nothing.best.fit, nothing.visible
    configured = Hypothesis.configured(base.hypothesis.model)
    moved = change_between(table, configured, base.hypothesis, settings)
    sure = drifted(table, base)
    if sure and moved.practical >= 1.0:
        absorbed = absorbed_explanations(table, base, nothing.absorbed)
        verdict = Verdict.UNIDENTIFIABLE if absorbed else Verdict.PARAMETER_DRIFT
        return Decision(verdict, nothing.best, absorbed=absorbed, notes=notes, visible=seen)
    if sure:
        words = "coefficients have moved for certain, and stops change by no more than"
        notes = (*notes, f"{words} {1000.0 * moved.length:.0f} mm by it: the model stays")
    least = settings.noisy_share * float(np.median(table.distance))
    noisy = bool(seen) and float(np.median(list(seen.values()))) > least
    verdict = Verdict.TOO_NOISY if noisy else Verdict.NONE
    return Decision(verdict, nothing.best, notes=notes, visible=seen)


def drifted(table: StopTable, base: Fit) -> bool:
    """The configured coefficients do not fit the log, the refitted ones do better than chance."""
    h = base.hypothesis
    as_it_is = replace(type(h).configured(h.model), oscillation=h.oscillation)
    configured = fit(table, as_it_is, base.white, passes=0)
    few = len(table) / max(len(table) - 5, 1)
    return configured.deviance - base.deviance > few * float(chi2.isf(P_DRIFT, 5))


def _matters(table: StopTable, base: Fit, best: ScoredExplanation, left: Followed) -> bool:
    """What is left along an axis is more than a trace of what the names explain."""
    used = table.spread > 0.0
    before = float(np.mean(residual(table, base.hypothesis)[used] ** 2))
    after = float(np.mean(residual(table, best.fit.hypothesis)[used] ** 2))
    return left.removed > LEFT_SHARE * max(before - after, 0.0)


def _numbers_at_their_end(best: ScoredExplanation) -> str:
    """Numbers of the effects that the fit pushed as far as it may, in words."""
    said = []
    for effect in best.fit.hypothesis.added:
        for name, value in effect.parameters.items():
            low, high = LAWS[effect.name].parameters[name].typical
            if value >= high * (1.0 - AT_BOUND) or (low > 0.0 and value <= low * 1.001):
                said.append(f"{name} of {effect.name}")
    return ", ".join(said)


def _unusually_small(found: ScoredExplanation) -> bool:
    """A number at the lower end of what is usual: brakes, say, that recover within each stop, which
    is a curve over speed by another name.
    """
    return any(
        0.0 < LAWS[e.name].parameters[name].typical[0] >= value / 1.001
        for e in found.fit.hypothesis.added
        for name, value in e.parameters.items()
    )


def _leads(
    best: ScoredExplanation, rival: ScoredExplanation, settings: DiscrepancySettings
) -> bool:
    """In nearly all resampled logs the best explanation stays ahead of a rival."""
    return _stability(best, rival, settings) >= STABLE_SHARE


def _stability(
    best: ScoredExplanation, rival: ScoredExplanation, settings: DiscrepancySettings
) -> float:
    ahead = rival.fit.each - best.fit.each
    prices = (rival.score - rival.fit.deviance) - (best.score - best.fit.deviance)
    rng = np.random.default_rng(settings.seed)
    draws = rng.integers(0, len(ahead), (settings.resamples, len(ahead)))
    return float(np.mean(ahead[draws].sum(axis=1) + prices > 0.0))


def _confidences(
    best: ScoredExplanation,
    found: Identified,
    sizes: Sequence[ChangeOfStops],
    settings: DiscrepancySettings,
) -> tuple[float, ...]:
    """Of each effect of an explanation: how sure its name is.

    The posterior weight of all explanations that hold the name, among those tried, or if that is
    less, the share of resampled logs in which the best of them leads the best of those without. A
    build-up is weighed against none.
    """
    everything = (best, *found.others)
    weight = np.exp(-0.5 * np.clip([e.score - best.score for e in everything], 0.0, 200.0))
    result = []
    added = best.fit.hypothesis.added
    for i, (effect, size) in enumerate(zip(added, sizes, strict=True)):
        often = sum(e.name == effect.name for e in added[: i + 1])
        has = np.array([e.names.count(effect.name) >= often for e in everything])
        posterior = float(np.sum(weight[has]) / np.sum(weight))
        without = [e for e, yes in zip(everything, has, strict=True) if not yes]
        rival = min(without, key=lambda e: e.score, default=None)
        if builds_up(effect):
            posterior, rival = 1.0 / (1.0 + np.exp(-0.5 * np.clip(size.gain, -200.0, 200.0))), None
        stable = 1.0 if rival is None else _stability(best, rival, settings)
        # Of so many draws, none that says otherwise does not mean never.
        result.append(min(posterior, stable, 1.0 - 0.5 / (settings.resamples + 1)))
    return tuple(result)
