"""Which effects of the library, alone or together, explain what the refitted base leaves.

Level by level: every explanation so far is extended by whatever the library still explains beyond
chance, refitted exactly, and weighed with the noise that the best of them leaves. Wrong first steps
are recovered from, because several explanations go on side by side.

Scores are −2 log likelihood plus log(stops) for each number that was chosen (Schwarz 1978), so that
effects with many inner numbers have to earn them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.discrepancy import screening
from models.discrepancy.candidates import Candidate, candidates, finer_patches
from models.discrepancy.hypothesis import Hypothesis, free_parameters
from models.discrepancy.noise import Noise
from models.discrepancy.prediction import as_output, lag_of
from models.discrepancy.refine import (
    Fit,
    fit_either_way,
    fit_with_scatter,
    noise_of,
    prior_precision,
    residual,
)
from models.discrepancy.settings import DiscrepancySettings
from models.discrepancy.stop_table import StopTable

Floats = NDArray[np.float64]

_NAMES = 6  # of the library that are refitted exactly at each step
_BEAM = 3
_CLOSER = (
    0.5,
    0.4,
    0.3,
    0.2,
    0.15,
    0.1,
    0.07,
    0.05,
)  # radii by which patches nearer to the best are moved
_NEAR = 30.0  # chi square from the best within which an explanation goes on
_MOVES = 2
_LENIENT = 0.2
_LEAST_LAG, _BLURS = 0.02, 2.5  # [s], standard deviations of the onset
_MORE = 6.0  # chi square that every further effect has to bring beyond its numbers
_WORTH = 0.4  # of the strongest candidate's chi square, below which another one is left alone
_STARTS = {"wheel_lockup": 2, "headwind": 2, "brake_fade": 2, "brake_lag": 1}
_EVENS_OUT = ("wheel_lockup",)
_NUMBERS = {"surface_patch": 4, "step_change": 2, "headwind": 3, "brake_fade": 2}
_DIRECTIONS = {"directional_surface": 2}


@dataclass(frozen=True, slots=True)
class Explanation:
    """Effects that are believed together.

    Attributes:
        fit: at their best. score: lower is better.
        gained: chi square that each effect brought when it joined. needed: that chance would bring.
    """

    fit: Fit
    score: float
    gained: tuple[float, ...] = ()
    needed: tuple[float, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of the alphabet."""
        return tuple(sorted(self.fit.hypothesis.names))


@dataclass(frozen=True, slots=True)
class Identified:
    """Outcome of the search.

    Attributes:
        best: none or several effects. others: further explanations, best first.
        largest: chi square of the strongest candidate beyond `best`, and its threshold.
        absorbed: share of each effect's column that the base takes up, by name.
    """

    best: Explanation
    others: tuple[Explanation, ...]
    largest: tuple[float, float]
    absorbed: dict[str, float]


def numbers(name: str) -> int:
    """Numbers that naming an effect chooses."""
    return _NUMBERS.get(name, _DIRECTIONS.get(name, 1))


def score(found: Fit, stops: int) -> float:
    """−2 log likelihood with the price of all chosen numbers."""
    chosen = sum(numbers(name) for name in found.hypothesis.names)
    more = max(len(found.hypothesis.names) - 1, 0)
    return found.deviance + chosen * float(np.log(stops)) + _MORE * more


def identify(table: StopTable, base: Fit, settings: DiscrepancySettings) -> Identified:
    """Search the library.

    Args:
        table: stops. base: refitted without further effects. settings: how sure to be.
    """
    beam = [Explanation(base, score(base, len(table)))]
    known = {beam[0].names: beam[0]}
    best = beam[0]
    absorbed: dict[str, float] = {}
    largest = (0.0, np.inf)
    for level in range(settings.most_effects + 1):
        children: list[Explanation] = []
        for parent in beam:
            more, strongest, shares = _extended(table, parent, settings)
            absorbed = absorbed or shares
            if parent.names == best.names:
                largest = strongest
            if level < settings.most_effects:
                children += more
        children = [c for c in children if c.names not in known]
        if not children:
            break
        children.sort(key=lambda c: c.score)
        if children[0].score >= best.score:
            break
        noise = noise_of(table, children[0].fit)
        known |= {c.names: c for c in reversed(children)}
        known = _again(table, known, noise, children[0].score)
        ordered = sorted(known.values(), key=lambda e: e.score)
        best = ordered[0]
        deep = [e for e in ordered if len(e.names) == level + 1]
        beam = [e for e in deep[:_BEAM] if e.score < best.score + _NEAR]
    others = sorted((e for e in known.values() if e.names != best.names), key=lambda e: e.score)
    return Identified(best, tuple(others), largest, absorbed)


def _again(
    table: StopTable, known: dict[tuple[str, ...], Explanation], noise: Noise, near: float
) -> dict[tuple[str, ...], Explanation]:
    """All explanations weighed anew, those far off forgotten but for the base."""
    result = {}
    for names, e in known.items():
        if names and e.score > near + 3.0 * _NEAR:
            continue
        # Speeds are the explanation's own now: noise of the measured ones no longer matters.
        output = as_output(table, e.fit.hypothesis)
        found = fit_either_way(output, e.fit.hypothesis, noise, rounds=1)
        result[names] = replace(e, fit=found, score=score(found, len(table)))
    return result


def _extended(
    table: StopTable, parent: Explanation, settings: DiscrepancySettings
) -> tuple[list[Explanation], tuple[float, float], dict[str, float]]:
    """Children of an explanation, its strongest candidate beside chance, absorbed shares."""
    fit = parent.fit
    found, z, sums, scored = screen(table, fit)
    one_sided = np.array([c.one_sided for c in found])
    strength = np.where(one_sided, np.maximum(z, 0.0), np.abs(z)) ** 2
    chances = screening.chance(
        sums, one_sided, fit.noise.scatter, settings.bootstraps, settings.seed
    )
    needed = screening.threshold(chances, settings.false_alarm)
    strongest = (float(strength.max()), needed)
    shares: dict[str, float] = {}
    for c, share in zip(found, scored.absorbed, strict=True):
        shares[c.name] = min(shares.get(c.name, 1.0), float(share))
    floor = max(needed, _WORTH * strongest[0])
    children = []
    for name, members in _leaders(found, strength):
        # A friction cap shows less in what it takes than in stops that no longer differ.
        hidden = name in _EVENS_OUT
        if name in fit.hypothesis.names or not (hidden or strength[members[0]] >= 0.5 * floor):
            continue
        if strongest[0] < needed and not hidden:
            continue
        fits = [_refined(table, fit, found[i], float(scored.strength[i])) for i in members]
        best = min(fits, key=lambda f: f.deviance)
        if (hidden and fit.deviance - best.deviance < needed) or _too_quick(table, best):
            continue
        gain = (*parent.gained, float(strength[members[0]]))
        children.append(Explanation(best, score(best, len(table)), gain, (*parent.needed, needed)))
    return children, strongest, shares


def _too_quick(table: StopTable, found: Fit) -> bool:
    """A lag that is no longer than the onset is uncertain: the jitter alone rounds the knee."""
    lag = lag_of(found.hypothesis)
    blur = np.hypot(found.noise.jitter, table.sample / np.sqrt(12.0))
    return 0.0 < lag < max(_LEAST_LAG, _BLURS * float(blur))


def rescued(
    table: StopTable, best: Explanation, settings: DiscrepancySettings
) -> list[Explanation]:
    """Effects that chance may bring in one log of five, for a pattern that is surely there."""
    lenient = replace(settings, false_alarm=_LENIENT)
    children = _extended(table, best, lenient)[0]
    noise = noise_of(table, best.fit)
    known = {c.names: c for c in [best, *children]}
    again = _again(table, known, noise, best.score)
    return sorted(again.values(), key=lambda e: e.score)


def screen(
    table: StopTable, fit: Fit
) -> tuple[list[Candidate], Floats, screening.Reduced, screening.Scores]:
    """Scores of all candidates beyond a fit; places of patches refined."""
    white = fit.white
    r = white.split(white.bins @ residual(table, fit.hypothesis)[:, :, None])
    left = r[0][:, 0], r[1].ravel()
    precision = prior_precision(fit.hypothesis)
    found, columns = candidates(table, fit.hypothesis)
    sums = screening.reduced(white, fit.jacobian, columns, precision)
    scored = screening.scores(sums, left, fit.noise.scatter)
    patches = [i for i, c in enumerate(found) if c.name == "surface_patch"]
    if patches:
        best = max(patches, key=lambda i: abs(scored.z[i]))
        nearest, scored.z[best], scored.strength[best] = _nearest_patch(
            table, fit, left, (found[best], float(scored.z[best]), float(scored.strength[best]))
        )
        found[best] = nearest
    return found, scored.z, sums, scored


_Patch = tuple[Candidate, float, float]


def _nearest_patch(table: StopTable, fit: Fit, left: tuple[Floats, Floats], best: _Patch) -> _Patch:
    """The patch near a given one that explains most: candidate, z, strength."""
    precision = prior_precision(fit.hypothesis)
    for closer in _CLOSER:
        more, shares = finer_patches(table, fit.hypothesis, best[0], closer)
        if not more:
            break
        own = screening.reduced(fit.white, fit.jacobian, shares, precision)
        tried = screening.scores(own, left, fit.noise.scatter)
        k = int(np.argmax(np.abs(tried.z)))
        if abs(tried.z[k]) > abs(best[1]):
            best = more[k], float(tried.z[k]), float(tried.strength[k])
    return best


def _moved_patch(table: StopTable, found: Fit) -> Fit:
    """The same with its last effect, a patch, where it fits best now that less is unexplained."""
    h = found.hypothesis
    patch = h.added[-1]
    without = replace(
        found,
        hypothesis=replace(h, added=h.added[:-1]),
        jacobian=found.jacobian[:, :, : -len(free_parameters(patch))],
    )
    r = found.white.split(found.white.bins @ residual(table, without.hypothesis)[:, :, None])
    inner = {name: patch.parameters[name] for name in ("x", "y", "radius")}
    here = Candidate("surface_patch", "delta", False, inner)
    nearest, z, strength = _nearest_patch(
        table, without, (r[0][:, 0], r[1].ravel()), (here, 0.0, 0.0)
    )
    if z == 0.0:
        return found
    moved = without.hypothesis.plus(nearest.effect(strength))
    better = fit_with_scatter(table, moved, found.noise)
    return better if better.deviance < found.deviance else found


def _leaders(found: Sequence[Candidate], strength: Floats) -> list[tuple[str, list[int]]]:
    """Names with the grid points to start from, the strongest names first."""
    members: dict[str, list[int]] = {}
    for i in np.argsort(-strength):
        own = members.setdefault(found[i].name, [])
        if (strength[i] > 0.0 or found[i].name in _EVENS_OUT) and len(own) < _STARTS.get(
            found[i].name, 1
        ):
            own.append(int(i))
    leaders = [(name, own) for name, own in members.items() if own]
    late = [leader for leader in leaders[_NAMES:] if leader[0] in _EVENS_OUT]
    return leaders[:_NAMES] + late


def _refined(table: StopTable, fit: Fit, candidate: Candidate, strength: float) -> Fit:
    trials = [candidate.effect(strength)]
    noise = replace(fit.noise, capped=True)
    if candidate.name == "step_change":
        force = float(np.median(table.force))
        trials.append(
            replace(
                trials[0],
                parameters={
                    "delta": (trials[0].parameters["scale"] - 1.0) * force,
                    "run": trials[0].parameters["run"],
                },
            )
        )
    fits = [fit_with_scatter(table, fit.hypothesis.plus(t), noise, rounds=1) for t in trials]
    best = min(fits, key=lambda f: f.deviance)
    if candidate.name == "surface_patch":
        for _ in range(_MOVES):
            best = _moved_patch(table, best)
    return best


def base_of(hypothesis: Hypothesis) -> Hypothesis:
    """Without the effects that were added."""
    return replace(hypothesis, added=())
