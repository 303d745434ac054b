"""A scan by generalised least squares: one effect of the library at a time beside the base.

The base, its dead time and the scatter of the stops (friction, dead time, noise) are fitted by
maximum likelihood; every effect is then one column more. What is gained is twice the log
likelihood, less log(stops) for each number chosen (Schwarz, 1978), with the scatter fitted anew.
The best is kept if it gains more than a threshold from clean logs, and so on; what changes stops
by less than a practical size stays in the model and is not named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .peer_base import BaseFit, fit_base, likeliest, whitened
from .peer_regressors import Candidate, candidates
from .physics import Floats
from .sensing import Columns

THRESHOLD = 25.0
"""Of what an effect gains."""

_MOST = 4  # effects
_ANYWHERE = "surface_patch"  # may lie in several places
_REFITTED = 6  # names whose scatter is fitted anew in each step
_SURE = 100.0  # gain from which on the first effect counts whole if it is a term of motion
MOTION = ("aerodynamic_drag", "viscous_resistance", "headwind")
SHARE, LENGTH, STOPS = 0.0125, 0.025, 3
"""Practical size: that many stops change by that share, or that many metres if it is more."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptEffect:
    """An effect in the model: what it gained when it came in, and whether it matters in size."""

    candidate: Candidate
    gain: float


def name_effects(columns: Columns, configured: dict[str, float]) -> tuple[str, ...]:
    """Names of the effects that are missing, the first found first; none where the base does."""
    found = fit_base(columns, configured)
    kept = scan(found)
    names = [one.candidate.name for one in kept if matters(found, one, kept)]
    return tuple(dict.fromkeys(names))


def scan(found: BaseFit, threshold: float = THRESHOLD) -> list[KeptEffect]:
    """Effects that are kept: the best is added, all are placed anew, what is not needed goes."""
    every, kept = list(candidates(found)), list[KeptEffect]()
    for _ in range(_MOST):
        best = _best(found, every, kept)
        if best is None or best.gain < threshold:
            break
        kept = [*kept, best]
        for i, one in enumerate(kept[:-1]):
            kept[i] = _placed_anew(found, every, one, kept)
        found = found._replace(**likeliest(found, together(found, kept))._asdict())
        kept = [one for one in kept if one is best or _cost(found, one, kept) >= threshold]
    return kept


def _placed_anew(
    found: BaseFit, every: list[Candidate], one: KeptEffect, kept: list[KeptEffect]
) -> KeptEffect:
    """The same effect at the point of its grid that suits best beside the others."""
    alike = [other for other in every if other.name == one.candidate.name]
    others = together(found, [other for other in kept if other is not one])
    best = int(np.argmax(gains(found, others, alike)))
    return KeptEffect(alike[best], one.gain)


def _cost(found: BaseFit, one: KeptEffect, kept: list[KeptEffect]) -> float:
    """What leaving it out would cost."""
    others = together(found, [other for other in kept if other is not one])
    numbers = one.candidate.numbers * float(np.log(len(found.lost)))
    return likeliest(found, others, 60).fit - found.fit - numbers


def together(found: BaseFit, kept: list[KeptEffect]) -> Floats:
    """(n, BINS, k) columns of the base and of what is kept."""
    return np.concatenate([found.base, *(one.candidate.columns for one in kept)], axis=2)


def _best(found: BaseFit, every: list[Candidate], kept: list[KeptEffect]) -> KeptEffect | None:
    """The effect that gains most beside the base and what is kept."""
    known = together(found, kept)
    there = {one.candidate.name for one in kept} - {_ANYWHERE}
    every = [one for one in every if one.name not in there]
    firsts: dict[str, tuple[float, Candidate]] = {}
    for gain, one in zip(gains(found, known, every), every, strict=True):
        if gain > firsts.get(one.name, (0.0, one))[0]:
            firsts[one.name] = (gain, one)
    ranked = sorted(firsts.values(), key=lambda first: -first[0])[:_REFITTED]
    stops = len(found.lost)
    refitted = []
    for _, one in ranked:
        fit = likeliest(found, np.concatenate((known, one.columns), axis=2), 60).fit
        refitted.append(KeptEffect(one, found.fit - fit - one.numbers * float(np.log(stops))))
    return max(refitted, key=lambda one: one.gain, default=None)


def gains(found: BaseFit, known: Floats, every: list[Candidate]) -> Floats:
    """(len(every),) fall of χ² by each beside the known columns, with the scatter as it is."""
    widths = [one.columns.shape[2] for one in every]
    stacked = np.concatenate([known, *(one.columns for one in every)], axis=2)
    rows, wanted = whitened(found, stacked, found.scatter)
    q, _ = np.linalg.qr(rows[:, : known.shape[2]])
    left = wanted - q @ (q.T @ wanted)
    free = rows[:, known.shape[2] :]
    free = free - q @ (q.T @ free)
    begins = np.cumsum([0, *widths])
    result = np.zeros(len(every))
    for i, one in enumerate(every):
        own = free[:, begins[i] : begins[i + 1]]
        gram, product = own.T @ own, own.T @ left
        if np.min(np.linalg.eigvalsh(gram)) < 1e-9:
            continue  # the base has it already
        strength = np.linalg.solve(gram, product)
        if not (one.positive and strength[0] < 0.0):
            result[i] = float(product @ strength)
    return result


def matters(found: BaseFit, one: KeptEffect, kept: list[KeptEffect]) -> bool:
    """What the other columns cannot take up of it changes stops by a practical size."""
    return size(found, one, kept) >= 1.0


def size(found: BaseFit, one: KeptEffect, kept: list[KeptEffect]) -> float:
    """Change of stops by it that the other columns cannot take up, over the practical one."""
    others = together(found, [other for other in kept if other is not one])
    own = one.candidate.columns
    rows, wanted = whitened(found, np.concatenate((others, own), axis=2), found.scatter)
    strength = np.linalg.lstsq(rows, wanted, rcond=None)[0][-own.shape[2] :]
    changed = own @ strength
    if not (one is kept[0] and one.candidate.name in MOTION and one.gain >= _SURE):
        changed = left_by(found, others, changed)
    return over_practical(found, changed)


def left_by(found: BaseFit, columns: Floats, changed: Floats) -> Floats:
    """(n, BINS) changes of the speed less what (n, BINS, k) columns can take up of them."""
    root = np.sqrt(found.traces.samples.ravel())
    free = columns.reshape(len(root), -1)
    taken = np.linalg.lstsq(free * root[:, None], changed.ravel() * root, rcond=None)[0]
    left: Floats = changed - columns @ taken
    return left


def over_practical(found: BaseFit, changed: Floats) -> float:
    """By how much (n, BINS) changes of the speed move enough stops, over a practical length."""
    t = found.traces
    lasting = t.binned(t.step) * t.samples
    way = np.sum(t.binned(t.v) * lasting * (t.binned(t.since) > 0.0), axis=1)
    moved = np.abs(np.sum(changed * lasting, axis=1)) / np.maximum(SHARE * way, LENGTH)
    return float(np.sort(moved)[-STOPS])
