"""Which effects of the library, alone or together, explain what the refitted base leaves.

Level by level: every explanation so far is extended by whatever the library still explains beyond
chance, refitted exactly, and weighed with the noise that the best of them leaves. Wrong first steps
are recovered from, because several explanations go on side by side.

Scores are −2 log likelihood plus log(stops) for each number that was chosen (Schwarz 1978), so that
effects with many inner numbers have to earn them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.noise import Noise
from slopewise.models.discrepancy.progress import Progress
from slopewise.models.discrepancy.search import screening
from slopewise.models.discrepancy.search.candidates import (
    EffectColumn,
    candidates,
    is_cap,
    patch_column,
    search_of,
)
from slopewise.models.discrepancy.search.patches import (
    left_of,
    moved_patch,
    placed_patch,
    settled_patches,
)
from slopewise.models.discrepancy.search.refine import (
    Fit,
    as_output,
    fit_either_way,
    fit_other_forms,
    fit_with_scatter,
    noise_of,
    prior_precision,
    with_build_up,
)
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import (
    BEAM,
    BEAM_WIDTH,
    FURTHER_PRICE,
    LEAST_FRICTION,
    LENIENT_ALARM,
    NAMES_REFITTED,
    SLIDING_QUANTILE,
    WORTH_MOVING,
    WORTH_REFITTING,
)
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect


@dataclass(frozen=True, slots=True)
class ScoredExplanation:
    """Effects that are believed together.

    Attributes:
        fit: at their best. score: lower is better.
    """

    fit: Fit
    score: float

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of the alphabet."""
        return tuple(sorted(self.fit.hypothesis.names))


@dataclass(frozen=True, slots=True)
class Identified:
    """Outcome of the search.

    Attributes:
        best: none or several effects. others: further explanations, best first.
        absorbed: share of each effect's column that the base takes up, by name.
        visible: change of a stop beyond new coefficients from which each effect would have been
            seen in this log [m], see :func:`slopewise.models.discrepancy.search.screening.visible`.
    """

    best: ScoredExplanation
    others: tuple[ScoredExplanation, ...]
    absorbed: dict[str, float]
    visible: dict[str, float]


def holds(more: tuple[str, ...], fewer: tuple[str, ...]) -> bool:
    """Whether names hold others and more than those, each as often as it is there."""
    return Counter(fewer) < Counter(more)


def numbers(name: str) -> int:
    """Numbers that naming an effect chooses."""
    law = LAWS[name]
    chosen = None if law.search is None else law.search.chosen
    return len(law.parameters) if chosen is None else chosen


def score(found: Fit, stops: int) -> float:
    """−2 log likelihood with the price of all chosen numbers."""
    chosen = sum(numbers(name) for name in found.hypothesis.names)
    more = max(len(found.hypothesis.names) - 1, 0)
    return found.deviance + chosen * float(np.log(stops)) + FURTHER_PRICE * more


def identify(
    table: StopTable, base: Fit, settings: DiscrepancySettings, progress: Progress | None = None
) -> Identified:
    """Search the library.

    Args:
        table: stops. base: refitted without further effects. settings: how sure to be.
        progress: told how far the search is.
    """
    beam = [ScoredExplanation(base, score(base, len(table)))]
    known = {beam[0].names: beam[0]}
    best = beam[0]
    absorbed: dict[str, float] = {}
    visible: dict[str, float] = {}
    for level in range(settings.most_effects + settings.most_patches):
        children: list[ScoredExplanation] = []
        for index, parent in enumerate(beam):
            extended = _extended(table, parent, settings)
            if progress is not None:
                progress.search(level, (index + 1) / len(beam))
            absorbed, visible = absorbed or extended.absorbed, visible or extended.visible
            children += extended.children
        children = [c for c in children if c.names not in known]
        if not children:
            break
        children.sort(key=lambda c: c.score)
        if children[0].score >= best.score:
            break
        noise = noise_of(table, children[0].fit)
        known |= {c.names: c for c in reversed(children)}
        known = _again(table, known, noise, children[0].score)
        known |= _with_one_less(table, min(known.values(), key=lambda e: e.score), known)
        ordered = sorted(known.values(), key=lambda e: e.score)
        best = ordered[0]
        deep = [e for e in ordered if len(e.names) == level + 1]
        beam = [e for e in deep[:BEAM] if e.score < best.score + BEAM_WIDTH]
        beam += _slippery(best, deep[len(beam) :])
    known = _with_build_up(table, known, best)
    best = min(known.values(), key=lambda e: e.score)
    others = sorted((e for e in known.values() if e.names != best.names), key=lambda e: e.score)
    settled = settled_patches(as_output(table, best.fit), best.fit)
    if settled is not best.fit:
        best = replace(best, fit=settled, score=score(settled, len(table)))
    return Identified(best, tuple(others), absorbed, visible)


def _slippery(
    best: ScoredExplanation, others: Sequence[ScoredExplanation]
) -> list[ScoredExplanation]:
    """Places that are slippery, where friction that caps all ground is ahead of them so far.

    One cap imitates several places, and is fewer numbers than the first of them.
    """
    if not any(map(is_cap, best.names)):
        return []
    return [e for e in others if e.fit.hypothesis.slips][:1]


def _again(
    table: StopTable, known: dict[tuple[str, ...], ScoredExplanation], noise: Noise, near: float
) -> dict[tuple[str, ...], ScoredExplanation]:
    """All explanations weighed anew, those far off forgotten but for the base."""
    result = {}
    for names, e in known.items():
        far = e.score > near + 3.0 * BEAM_WIDTH
        if names and far and not e.fit.hypothesis.slips:
            continue
        # Speeds are the explanation's own now: noise of the measured ones no longer matters.
        output = as_output(table, e.fit)
        found = fit_either_way(output, e.fit.hypothesis, noise, rounds=1)
        if e.score < near + BEAM_WIDTH:
            found = fit_other_forms(output, found)
        result[names] = replace(e, fit=found, score=score(found, len(table)))
    return result


def _with_build_up(
    table: StopTable, known: dict[tuple[str, ...], ScoredExplanation], best: ScoredExplanation
) -> dict[tuple[str, ...], ScoredExplanation]:
    """All near explanations with a build-up of the brakes, where an effect had hidden it."""
    if not best.names:
        return known
    output = as_output(table, best.fit)
    built = with_build_up(output, best.fit, best.fit.noise)
    if built is best.fit:
        return known
    result = known | {best.names: ScoredExplanation(built, score(built, len(table)))}
    for names, e in known.items():
        if e is not best and (not names or e.score < best.score + BEAM_WIDTH):
            found = with_build_up(output, e.fit, best.fit.noise)
            result[names] = ScoredExplanation(found, score(found, len(table)))
    return result


def _with_one_less(
    table: StopTable, best: ScoredExplanation, known: dict[tuple[str, ...], ScoredExplanation]
) -> dict[tuple[str, ...], ScoredExplanation]:
    """Explanations without one of the effects of the best: a first step may have been wrong."""
    added = best.fit.hypothesis.added
    rests = [
        replace(best.fit.hypothesis, added=(*added[:i], *added[i + 1 :])) for i in range(len(added))
    ]
    missing = {tuple(sorted(rest.names)): rest for rest in rests}
    missing = {names: rest for names, rest in missing.items() if names not in known}
    if not missing:
        return {}
    output = as_output(table, best.fit)
    found = {}
    for names, rest in missing.items():
        refit = fit_either_way(output, rest, best.fit.noise, rounds=1)
        found[names] = ScoredExplanation(refit, score(refit, len(table)))
    return found


class _Extended(NamedTuple):
    """Children of an explanation, and what the log shows."""

    children: list[ScoredExplanation]
    absorbed: dict[str, float]
    visible: dict[str, float]


def _extended(
    table: StopTable, parent: ScoredExplanation, settings: DiscrepancySettings
) -> _Extended:
    fit = parent.fit
    found, columns, sums, scored = screen(table, fit)
    one_sided = np.array([c.search.one_sided for c in found])
    able = np.where(one_sided, np.maximum(scored.z, 0.0), np.abs(scored.z)) ** 2
    strength = scored.gain
    chances = screening.chance(
        sums, one_sided, fit.noise.scatter, settings.bootstraps, settings.seed
    )
    needed = screening.threshold(chances, settings.false_alarm)
    strongest = float(max(strength.max(), able.max()))
    shares: dict[str, float] = {}
    for c, share in zip(found, scored.absorbed, strict=True):
        shares[c.name] = min(shares.get(c.name, 1.0), float(share))
    visible: dict[str, float] = {}
    if not parent.names:
        sizes = screening.visible(sums, table, fit, columns, needed)
        # Nobody chooses where a surface lies or which way the wind blows: the middle of the grid.
        for name in dict.fromkeys(c.name for c in found):
            own = [s for c, s in zip(found, sizes.tolist(), strict=True) if c.name == name]
            visible[name] = float(np.median(own))
    floor = max(needed, WORTH_REFITTING * strongest)
    children = []
    for name, members in _leaders(found, strength):
        # A friction cap shows less in what it takes than in stops that no longer differ.
        hidden = is_cap(name)
        if not (hidden or strength[members[0]] >= 0.5 * floor):
            continue
        if not _room_for(name, fit.hypothesis.names, settings):
            continue
        if strongest < needed and not hidden:
            continue
        fits = [_refined(table, fit, found[i], float(scored.strength[i])) for i in members]
        best = min(fits, key=lambda f: f.deviance)
        if hidden and fit.deviance - best.deviance < needed:
            continue
        children.append(ScoredExplanation(best, score(best, len(table))))
    return _Extended(children, shares, visible)


def _room_for(name: str, names: tuple[str, ...], settings: DiscrepancySettings) -> bool:
    """Whether one more effect may join: another one, or a further place."""
    if name in names:
        places = sum(search_of(own).placed for own in names)
        return search_of(name).placed and places < settings.most_patches
    return len(set(names)) < settings.most_effects


def rescued(
    table: StopTable, best: ScoredExplanation, settings: DiscrepancySettings
) -> list[ScoredExplanation]:
    """Effects that chance may bring in one log of five, for a pattern that is surely there."""
    lenient = replace(settings, false_alarm=LENIENT_ALARM)
    children = _extended(table, best, lenient).children
    noise = noise_of(table, best.fit)
    known = {c.names: c for c in [best, *children]}
    again = _again(table, known, noise, best.score)
    return sorted(again.values(), key=lambda e: e.score)


def screen(
    table: StopTable, fit: Fit
) -> tuple[list[EffectColumn], Floats, screening.Reduced, screening.Scores]:
    """All candidates beyond a fit, their columns (S, M, Q), sums and scores."""
    found, columns = candidates(table, fit.hypothesis)
    patches = [i for i, c in enumerate(found) if c.search.placed]
    placed = placed_patch(table, fit, found[patches[0]].name) if patches else None
    if placed is not None:
        found[patches[0]] = placed[0]
        columns[:, :, patches[:1]] = patch_column(table, fit.hypothesis, placed[0])
    precision = prior_precision(fit.hypothesis)
    sums = screening.reduced(fit.white, fit.jacobian, columns, precision)
    one_sided = np.array([c.search.one_sided for c in found])
    scored = screening.scores(sums, left_of(table, fit), fit.noise.scatter, one_sided)
    return found, columns, sums, scored


def _leaders(found: Sequence[EffectColumn], strength: Floats) -> list[tuple[str, list[int]]]:
    """Names with the grid points to start from, the strongest names first."""
    members: dict[str, list[int]] = {}
    for i in np.argsort(-strength):
        own = members.setdefault(found[i].name, [])
        if (strength[i] > 0.0 or is_cap(found[i].name)) and len(own) < found[i].search.starts:
            own.append(int(i))
    leaders = [(name, own) for name, own in members.items() if own]
    late = [leader for leader in leaders[NAMES_REFITTED:] if is_cap(leader[0])]
    return leaders[:NAMES_REFITTED] + late


def _refined(table: StopTable, fit: Fit, candidate: EffectColumn, strength: float) -> Fit:
    h = fit.hypothesis
    trials = [h.plus(candidate.effect(strength))]
    noise = replace(fit.noise, capped=True)
    other_form = candidate.search.other_form
    if other_form is not None:
        values = other_form(trials[0].added[-1].parameters, float(np.median(table.force)))
        trials.append(h.plus(Effect(name=candidate.name, parameters=values)))
    if is_cap(candidate.name):
        # Where nearly all stops slide, coefficients fitted to them say nothing of the brakes.
        strong = replace(h, shift=np.zeros(4)).plus(candidate.effect(strength))
        free = strong.free
        sliding = np.quantile(table.force / np.cos(table.grade[:, -1]), SLIDING_QUANTILE)
        free[-1] = max(float(sliding), LEAST_FRICTION)
        trials.append(strong.moved(free))
    refit = fit_either_way if is_cap(candidate.name) else fit_with_scatter
    fits = [refit(table, t, noise, rounds=1) for t in trials]
    best = min(fits, key=lambda f: f.deviance)
    if candidate.search.placed and fit.deviance - best.deviance > WORTH_MOVING:
        best = moved_patch(table, best, len(best.hypothesis.added) - 1)
    return (
        fit_other_forms(table, best) if candidate.search.placed or is_cap(candidate.name) else best
    )
