"""Before, after, floor: how far simulated and measured stops are apart, on stops held out.

Whole runs are held out together. The floor is what a perfect model would leave: noise of the speed,
the friction and the onset that every stop has of its own. Where the gap is less than one and a half
times its floor no percentage is claimed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.findings import Gap
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.noise import Noise, shapes, whitener
from slopewise.models.discrepancy.model.prediction import simulate
from slopewise.models.discrepancy.search.refine import Fit, fit
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import CLAIM_ABOVE, SIMULATED_NODES, SIMULATED_SPAN
from slopewise.models.quantity import GRAVITY


def speed_errors(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, K) measured less simulated speed of the bins [m/s], NaN for bins that are none."""
    speed, _ = simulate(table, hypothesis, table.held, table.time)
    off = table.binned - np.einsum("skm,sm->sk", table.average, speed)
    return np.where(table.spread > 0.0, off, np.nan)


def distances(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S,) simulated stopping distance [m]; the farthest looked at if the vehicle rolls on."""
    longest = SIMULATED_SPAN * table.standstill_time + 0.5
    time = np.linspace(0.0, 1.0, SIMULATED_NODES) * longest[:, None]
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
        refit_squares: (S,) mean squared speed error of the refitted base, held out [m²/s²].
        ends: how much longer than configured stops are, the least and the most; negative where
            they are shorter [m].
    """

    speed: Gap
    distance: Gap
    held_out: Floats
    refit_squares: Floats
    ends: tuple[float, float]

    @property
    def harmful(self) -> bool:
        """What was found predicts speeds or distances worse than new coefficients do."""
        return max(self.speed.worse, self.distance.worse) > 1.0


def compared(
    table: StopTable, base: Fit, best: Fit, noise: Noise, settings: DiscrepancySettings
) -> Gaps:
    """Model as configured, base refitted, and what was found.

    Args:
        table: stops. base: refitted base. best: what was found; its structure is kept, its numbers
            are fitted anew to what each part of the log leaves.
        noise: of a perfect model, of which all structure that is known to be there is taken off.
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
    floor = np.where(used, speed_floor(table, noise, best.hypothesis), np.nan)
    squares = [np.nanmean(e[0] ** 2, axis=1) for e in (before, refit, after)]
    speed = gap_of("speed while stopping, rms", "m/s", (*squares, np.nanmean(floor, axis=1)), draws)
    lengths = [(e[1] - table.distance) ** 2 for e in (before, refit, after)]
    distance = gap_of(
        "stopping distance, rms", "m", (*lengths, distance_floor(table, noise)), draws
    )
    longer = table.distance - before[1]
    ends = float(longer.min()), float(longer.max())
    return Gaps(speed, distance, after[1], squares[1], ends)


def held_out(table: StopTable, parts: list[Bools], start: Fit) -> tuple[Floats, Floats]:
    """By fits that have not seen the stop: (S, K) speed errors, (S,) distances."""
    errors = np.full(table.binned.shape, np.nan)
    lengths = np.empty(len(table))
    for part in parts:
        seen, unseen = table.take(~part), table.take(part)
        white = whitener(seen, start.noise, start.hypothesis)
        learned = fit(seen, start.hypothesis, white).hypothesis
        errors[part] = speed_errors(unseen, learned)
        lengths[part] = distances(unseen, learned)
    return errors, lengths


def speed_floor(table: StopTable, noise: Noise, hypothesis: Hypothesis) -> Floats:
    """(S, K) variance of the speed errors of a perfect model [m²/s²]."""
    z = shapes(table, hypothesis, noise.capped)
    own = noise.speed**2 * table.own_spread
    dead_time_std = noise.dead_time_std * z[:, :, 2]
    friction = noise.scatter * z[:, :, 3]
    result: Floats = own + dead_time_std**2 + friction**2
    return result


def distance_floor(table: StopTable, noise: Noise) -> Floats:
    """(S,) variance of the distance errors of a perfect model [m²]."""
    by_force = table.held**2 / (2.0 * GRAVITY * table.pull**2)
    by_rest = (
        noise.speed * np.sqrt(np.median(table.spread[table.spread > 0.0])) * table.standstill_time
    )
    own: Floats = (
        (noise.scatter * by_force) ** 2 + (noise.dead_time_std * table.held) ** 2 + by_rest**2
    )
    return own


def gap_of(metric: str, unit: str, errors: Sequence[Floats], draws: Ints) -> Gap:
    """Root mean squares and the share that is closed.

    Args:
        errors: mean squared error of each stop (S,) as configured, refitted, with what was found,
            and of a perfect model. draws: (B, S) stops of each bootstrap sample.
    """
    squares = np.stack(errors)
    b, r, a, f = np.sqrt(squares.mean(axis=1))
    f = min(f, b, r, a)  # no model that is here already is better than a perfect one
    gap = Gap(
        metric,
        unit,
        float(b),
        float(r),
        float(a),
        float(f),
        None,
        None,
        _standard_errors(squares[2] - squares[1]),
    )
    if not b > CLAIM_ABOVE * f:
        return gap
    drawn = np.sqrt(squares[:, draws].mean(axis=2))
    shares = _share(drawn[0], drawn[2], drawn.min(axis=0))
    low, high = np.quantile(shares, [0.025, 0.975])
    return replace(gap, closed=float(_share(b, a, f)), ci95=(float(low), float(high)))


def _standard_errors(more: Floats) -> float:
    """Of the mean of differences (S,) of stops; 0 where none differs."""
    error = float(np.std(more, ddof=1) / np.sqrt(len(more)))
    return float(np.mean(more)) / error if error > 0.0 else 0.0


def _share(before: Floats, after: Floats, floor: Floats) -> Floats:
    above = np.maximum(before - floor, 1e-9)
    share: Floats = np.clip((before - np.maximum(after, floor)) / above, -1.0, 1.0)
    return share
