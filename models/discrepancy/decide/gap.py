"""Before, after, floor: how far simulated and measured stops are apart, on stops held out.

Whole runs are held out together. The floor is what a perfect model would leave: noise of the speed,
the individual friction and onset of every stop. Where the gap is less than one and a half
times its floor no percentage is claimed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.discrepancy.data.stop_table import NODES, StopTable
from slopewise.models.discrepancy.findings import Gap
from slopewise.models.discrepancy.likelihood.refit import Refit, without
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import simulate
from slopewise.models.discrepancy.settings import DiscrepancySettings

LARGER = 1.02  # errors after a finding over those before it that contradict it [1]
_CLAIM_ABOVE = 1.5  # floors that a gap needs for a percentage of it to mean something [1]
_SPAN = 2  # times a measured stop within which a simulated one has to end [1]


def speed_errors(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, K) measured less simulated speed of the bins [m/s], NaN for unused bins."""
    speed, _ = simulate(table, hypothesis, table.held, table.time)
    errors = table.binned - np.einsum("skm,sm->sk", table.average, speed)
    return np.where(table.spread > 0.0, errors, np.nan)


def distances(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S,) simulated stopping distance [m]; the end of the simulation if the vehicle rolls on."""
    longest = _SPAN * table.standstill_time + 0.5
    time = np.linspace(0.0, 1.0, _SPAN * (NODES - 1) + 1) * longest[:, None]
    _, station = simulate(table, hypothesis, table.held, time)
    return station[:, -1]


def folds(table: StopTable, count: int, seed: int) -> list[Bools]:
    """(S,) whether a stop is in a part, for each of ``count`` parts.

    Stops of a run stay together, or where runs are few, those that were driven one after another.
    """
    groups = table.run
    if len(np.unique(groups)) < count:
        groups = np.arange(len(table)) * 4 * count // len(table)
    names = np.unique(groups)
    order = np.random.default_rng(seed).permutation(names)
    return [np.isin(groups, part) for part in np.array_split(order, count)]


@dataclass(frozen=True, slots=True)
class Gaps:
    """Before and after, on stops held out.

    Attributes:
        speed, distance: as reported. held_out: (S,) distances by fits that had not seen their stop.
        ends: how much longer than configured stops are, the least and the most; negative where
            they are shorter [m].
    """

    speed: Gap
    distance: Gap
    held_out: Floats
    ends: tuple[float, float]

    @property
    def harmful(self) -> bool:
        """The finding predicts stops worse than as configured, or speeds than new coefficients."""
        larger = any(g.after > LARGER * g.before for g in (self.speed, self.distance))
        return larger or self.speed.after > LARGER * self.speed.refit


def compared(
    table: StopTable, base: Refit, best: Refit, whitener: Whitener, settings: DiscrepancySettings
) -> Gaps:
    """Model as configured, base refitted, and what was found.

    Args:
        table: stops. base: refitted base. best: what was found; its structure is kept, its numbers
            are fitted again without each part of the log.
        whitener: noise of a perfect model, without all known structure.
        settings: parts, draws and seed.
    """
    parts = folds(table, settings.folds, settings.seed)
    configured = Hypothesis.configured(best.hypothesis.model)
    before = speed_errors(table, configured), distances(table, configured)
    refit = held_out(table, parts, base)
    after = refit if best is base else held_out(table, parts, best)
    draws = np.random.default_rng(settings.seed).integers(
        0, len(table), (settings.resamples, len(table))
    )
    used = table.spread > 0.0
    floor = np.nanmean(np.where(used, whitener.variance, np.nan), axis=1)
    squares = [np.nanmean(e[0] ** 2, axis=1) for e in (before, refit, after)]
    speed = _gap("speed while stopping, rms", "m/s", np.stack([*squares, floor]), draws)
    lengths = [(e[1] - table.distance) ** 2 for e in (before, refit, after)]
    floor = distance_floor(table, whitener)
    distance = _gap("stopping distance, rms", "m", np.stack([*lengths, floor]), draws)
    longer = table.distance - before[1]
    ends = float(longer.min()), float(longer.max())
    return Gaps(speed, distance, after[1], ends)


def held_out(table: StopTable, parts: list[Bools], start: Refit) -> tuple[Floats, Floats]:
    """By fits that have not seen the stop: (S, K) speed errors, (S,) distances."""
    errors = np.full(table.binned.shape, np.nan)
    lengths = np.empty(len(table))
    for part in parts:
        unseen, learned = without(start, table, part)
        errors[part] = speed_errors(unseen, learned)
        lengths[part] = distances(unseen, learned)
    return errors, lengths


def distance_floor(table: StopTable, whitener: Whitener) -> Floats:
    """(S,) variance of the distance errors of a perfect model [m²]."""
    rest = float(whitener.noise[0]) * np.sqrt(np.median(table.spread[table.spread > 0.0]))
    variance = whitener.distance_variance(table.held, table.pull)
    floor: Floats = variance + (rest * table.standstill_time) ** 2
    return floor


def _gap(metric: str, unit: str, squares: Floats, draws: Ints) -> Gap:
    """Root mean squares and the share that is closed.

    Args:
        squares: (4, S) mean squared error of each stop as configured, refitted, with what was
            found, and of a perfect model. draws: (B, S) stops of each bootstrap sample.
    """
    b, r, a, f = np.sqrt(squares.mean(axis=1))
    f = min(f, b, r, a)  # no model that is here already is better than a perfect one
    gap = Gap(metric, unit, float(b), float(r), float(a), float(f), None, None)
    if not b > _CLAIM_ABOVE * f:
        return gap
    resampled = np.sqrt(squares[:, draws].mean(axis=2))
    low, high = np.quantile(
        _share(resampled[0], resampled[2], resampled.min(axis=0)), [0.025, 0.975]
    )
    return replace(gap, closed=float(_share(b, a, f)), ci95=(float(low), float(high)))


def _share(before: Floats, after: Floats, floor: Floats) -> Floats:
    above = np.maximum(before - floor, 1e-9)
    share: Floats = np.clip((before - np.maximum(after, floor)) / above, -1.0, 1.0)
    return share
