"""The baseline: a scan of the library by generalised least squares.

The base, its dead time and the scatter of the stops (friction, dead time, noise) are fitted by
maximum likelihood; each effect is then one column more. Its gain is twice the log likelihood, less
log(stops) for each chosen number (Schwarz, 1978), with the scatter refitted. The best effect is
added if it gains more than a threshold, set by clean logs, and so on. An effect that changes stops
by less than a practical size stays in the model and is not named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .gls_base import BaseFit, fit_base, fit_scatter, whitened
from .gls_columns import Candidate, candidates
from .plant_physics import Floats
from .sensing import Columns

THRESHOLD = 25.0
"""Gain from which an effect is added; chosen on 30 logs of the car's tuning half."""

_MAX_EFFECTS = 4  # twice as many as are ever hidden
_ANYWHERE = "surface_patch"  # may lie in several places
_REFITTED = 6  # best names, whose scatter is refitted in each step
_EVIDENT_GAIN = 100.0  # of a first term of motion, whose whole change then matters
MOTION = ("aerodynamic_drag", "viscous_resistance", "headwind")
SHARE, LENGTH, STOPS = 0.0125, 0.025, 3
"""Practical size: 3 stops change by 1.25 % of their length, or by 2.5 cm if that is more."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedEffect:
    """An effect in the model, with its gain when it was added."""

    candidate: Candidate
    gain: float


def name_effects(columns: Columns, configured: dict[str, float]) -> tuple[str, ...]:
    """Names of the missing effects, in the order of their discovery."""
    fit = fit_base(columns, configured)
    effects = scan(fit)
    names = [effect.candidate.name for effect in effects if is_practical(fit, effect, effects)]
    return tuple(dict.fromkeys(names))


def scan(fit: BaseFit, threshold: float = THRESHOLD) -> list[FittedEffect]:
    """Add the best effect, move all on their grids, drop those no longer needed, and repeat."""
    library, effects = list(candidates(fit)), list[FittedEffect]()
    for _ in range(_MAX_EFFECTS):
        best = _best(fit, library, effects)
        if best is None or best.gain < threshold:
            break
        effects = [*effects, best]
        for i, effect in enumerate(effects[:-1]):
            effects[i] = _moved(fit, library, effect, effects)
        fit = fit._replace(**fit_scatter(fit, _columns(fit, effects))._asdict())
        effects = [e for e in effects if e is best or _loss(fit, e, effects) >= threshold]
    return effects


def _columns(
    fit: BaseFit, effects: list[FittedEffect], without: FittedEffect | None = None
) -> Floats:
    """Columns of the base and of effects, shape (n, BINS, k)."""
    added = (effect.candidate.columns for effect in effects if effect is not without)
    return np.concatenate([fit.base, *added], axis=2)


def _moved(
    fit: BaseFit, library: list[Candidate], effect: FittedEffect, effects: list[FittedEffect]
) -> FittedEffect:
    """The effect at the best point of its grid, given the others."""
    grid = [candidate for candidate in library if candidate.name == effect.candidate.name]
    best = int(np.argmax(gains(fit, _columns(fit, effects, effect), grid)))
    return FittedEffect(grid[best], effect.gain)


def _loss(fit: BaseFit, effect: FittedEffect, effects: list[FittedEffect]) -> float:
    """Loss of likelihood without the effect."""
    numbers = effect.candidate.numbers * float(np.log(len(fit.lost)))
    return fit_scatter(fit, _columns(fit, effects, effect), 60).fit - fit.fit - numbers


def _best(
    fit: BaseFit, library: list[Candidate], effects: list[FittedEffect]
) -> FittedEffect | None:
    """The effect of largest gain, given base and effects."""
    known = _columns(fit, effects)
    present = {effect.candidate.name for effect in effects} - {_ANYWHERE}
    library = [candidate for candidate in library if candidate.name not in present]
    by_name: dict[str, tuple[float, Candidate]] = {}
    for gain, candidate in zip(gains(fit, known, library), library, strict=True):
        if gain > by_name.get(candidate.name, (0.0, candidate))[0]:
            by_name[candidate.name] = (gain, candidate)
    ranked = sorted(by_name.values(), key=lambda first: -first[0])[:_REFITTED]
    log_stops = float(np.log(len(fit.lost)))
    refitted = []
    for _, candidate in ranked:
        likelihood = fit_scatter(fit, np.concatenate((known, candidate.columns), axis=2), 60).fit
        gain = fit.fit - likelihood - candidate.numbers * log_stops
        refitted.append(FittedEffect(candidate, gain))
    return max(refitted, key=lambda effect: effect.gain, default=None)


def gains(fit: BaseFit, known: Floats, library: list[Candidate]) -> Floats:
    """Fall of χ² by each candidate, given known columns and scatter, shape (len(library),)."""
    widths = [candidate.columns.shape[2] for candidate in library]
    stacked = np.concatenate([known, *(candidate.columns for candidate in library)], axis=2)
    rows, target = whitened(fit, stacked, fit.scatter)
    q, _ = np.linalg.qr(rows[:, : known.shape[2]])
    left = target - q @ (q.T @ target)
    free = rows[:, known.shape[2] :]
    free = free - q @ (q.T @ free)
    first = np.cumsum([0, *widths])
    result = np.zeros(len(library))
    for i, candidate in enumerate(library):
        columns = free[:, first[i] : first[i + 1]]
        gram, product = columns.T @ columns, columns.T @ left
        if np.min(np.linalg.eigvalsh(gram)) < 1e-9:
            continue  # the base has it already
        strength = np.linalg.solve(gram, product)
        if not (candidate.positive and strength[0] < 0.0):
            result[i] = float(product @ strength)
    return result


def is_practical(fit: BaseFit, effect: FittedEffect, effects: list[FittedEffect]) -> bool:
    """Whether it changes stops, beyond what the other columns absorb, by a practical size."""
    known, columns = _columns(fit, effects, effect), effect.candidate.columns
    rows, target = whitened(fit, np.concatenate((known, columns), axis=2), fit.scatter)
    strength = np.linalg.lstsq(rows, target, rcond=None)[0][-columns.shape[2] :]
    changed: Floats = columns @ strength
    evident = effect is effects[0] and effect.gain >= _EVIDENT_GAIN
    if not (evident and effect.candidate.name in MOTION):
        root = np.sqrt(fit.traces.samples.ravel())
        free = known.reshape(len(root), -1)
        absorbed = np.linalg.lstsq(free * root[:, None], changed.ravel() * root, rcond=None)[0]
        changed = changed - known @ absorbed
    t = fit.traces
    duration = t.binned(t.step) * t.samples
    length = np.sum(t.binned(t.v) * duration * (t.binned(t.since) > 0.0), axis=1)
    moved = np.abs(np.sum(changed * duration, axis=1)) / np.maximum(SHARE * length, LENGTH)
    return float(np.sort(moved)[-STOPS]) >= 1.0
