"""How exactly a vehicle follows its paths: the keys of `[tracking]`, from logs with path and pose.

Errors have a mean of each session (a mount, a map, a day of GNSS) and a scatter within it that
grows with curvature and speed. A plan keeps space for a session that is not in the log: the spread
of the means, with its own uncertainty from few sessions, adds to the scatter within. Keys are
standard deviations of a normal law; where errors have heavier tails these are larger, so that the
quantiles that the log can show hold. Definitions: docs/vehicle_motion.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.special import gammaincinv, ndtri

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.tracking_samples import TrackingSamples
from slopewise.models.input_errors import Tracking, input_errors
from slopewise.models.stop_logs.random_effects import PER_MAD, fit_mean

_SESSIONS = 4
"""Fewest sessions [1]: of three the spread of their means is known to a factor of three only."""

_BLOCK = 5.0
"""Distance after which errors are new [m]: a tracker forgets an offset within some lookaheads."""

_BLOCKS = 20  # fewest of a session [1]: its mean is then known to a quarter of the scatter
_CONFIDENCE = 0.9  # of the spread of session means, one-sided [1]
_WINSOR = 5.0
"""Errors count for the law of the scatter up to that many times the median [1]: a lost position
must not tilt it. The quantiles count all of them."""

_MEAN_OF_HALF = float(np.sqrt(2.0 / np.pi))  # E|z| of a standard normal z [1]
_BEYOND = 5.0  # fewest independent errors beyond a quantile that the log can show [1]


@dataclass(frozen=True, slots=True)
class Spread:
    """Law of one error: σ² = between² + (level + per_curvature |κ| + per_speed v)².

    Attributes:
        level: [m] or [rad]. per_curvature: times 1/m. per_speed: times m/s.
        between: standard deviation of a new session's mean, its confidence included.
        tails: by how much the whole is larger, so that quantiles hold [1].
    """

    level: float
    per_curvature: float
    per_speed: float
    between: float
    tails: float


@dataclass(frozen=True, slots=True)
class TrackingFit:
    """Result of a fit of tracking errors.

    Attributes:
        tracking: the table with what was learned; unchanged where the log has too little data.
        cross_track, heading: laws, None where they were not learned.
        quantile: quantile of `held_out`.
        held_out: share of samples of each session beyond the band that the others give [1].
        sessions, blocks: number of sessions, and of independent blocks of :data:`_BLOCK` [1].
        note: a sentence for the user.
    """

    tracking: Tracking | None
    cross_track: Spread | None
    heading: Spread | None
    quantile: float
    held_out: tuple[float, ...]
    sessions: int
    blocks: int
    note: str


def fit_tracking(
    samples: TrackingSamples, known: Tracking | None, top_speed: float, quantile: float
) -> TrackingFit:
    """Learn the keys of `[tracking]` that poses determine; the others stay.

    Args:
        samples: errors of a log. known: present table.
        top_speed: speed up to which the keys hold [m/s]. quantile: quantile of the coverage.
    """
    blocks = _blocks_by_session(samples)
    enough = np.flatnonzero(blocks >= _BLOCKS)
    total = int(blocks.sum())
    if len(enough) < _SESSIONS:
        stays = "is unchanged" if known else "is not set: vehicles follow their lines exactly"
        note = (
            f"[tracking] {stays}: the log has {len(enough)} sessions with at least "
            f"{_BLOCKS * _BLOCK:.0f} m along a path, {_SESSIONS} are needed"
        )
        return TrackingFit(known, None, None, quantile, (), len(enough), total, note)
    use = np.isin(samples.session, enough)
    learned, cross, heading = _learn(samples, use, known, top_speed)
    held_out = []
    for session in enough:
        held = samples.session == session
        learned_elsewhere, _, _ = _learn(samples, use & ~held, known, top_speed)
        held_out.append(_beyond(samples, held, learned_elsewhere, quantile))
    worst = float(np.max(held_out))
    note = (
        f"[tracking] learned from {total * _BLOCK:.0f} m in {len(enough)} sessions: "
        f"{learned.cross_track_std:.3f} m + {learned.cross_track_per_curvature:.3f} m² |κ| across"
        f"{'' if heading is None else f', {learned.heading_std:.4f} rad of heading'}; each session "
        f"predicted by the others: {np.mean(held_out):.2%} of its samples beyond the band at "
        f"{quantile:g}, {worst:.2%} in the worst"
    )
    if samples.omitted:
        note += f"; {samples.omitted} samples were too far from a path to follow it"
    return TrackingFit(learned, cross, heading, quantile, tuple(held_out), len(enough), total, note)


def _learn(
    samples: TrackingSamples, use: Bools, known: Tracking | None, top_speed: float
) -> tuple[Tracking, Spread, Spread | None]:
    """The table from some of the samples, and its laws."""
    cross, turned = _spread(samples, use, samples.cross_track), use & np.isfinite(samples.heading)
    heading = _spread(samples, turned, samples.heading) if turned.any() else None
    fastest = max(top_speed, float(np.abs(samples.speed[use]).max()))
    # The keys know no speed: they hold at the highest.
    flat = cross.level + cross.per_speed * fastest
    learned = replace(
        known or Tracking(),
        cross_track_std=cross.tails * float(np.hypot(flat, cross.between)),
        cross_track_per_curvature=cross.tails * cross.per_curvature,
    )
    if heading is not None:
        tightest = float(np.abs(samples.curvature[use]).max())
        within = heading.level + heading.per_speed * fastest + heading.per_curvature * tightest
        std = heading.tails * float(np.hypot(within, heading.between))
        learned = replace(learned, heading_std=min(std, 0.5))
    return learned, cross, heading


def _spread(samples: TrackingSamples, use: Bools, error: Floats) -> Spread:
    """Law of an error over sessions."""
    present = np.unique(samples.session[use])
    medians, noise = np.empty((2, len(present)))
    residual, blocks = np.zeros(len(error)), _blocks_by_session(samples)
    for n, session in enumerate(present):
        rows = use & (samples.session == session)
        medians[n] = np.median(error[rows])
        residual[rows] = error[rows] - medians[n]
        deviation = PER_MAD * float(np.median(np.abs(residual[rows])))
        # The median of n normal values scatters by √(π/2) of their mean.
        noise[n] = 1.2533 * max(deviation, 1e-6) / np.sqrt(max(blocks[session], 1))
    law = _scatter_law(samples, use, residual)
    between = _between(medians, noise)
    spread = Spread(*law, between, 1.0)
    return replace(spread, tails=_tails(samples, use, error, spread))


def _scatter_law(
    samples: TrackingSamples, use: Bools, residual: Floats
) -> tuple[float, float, float]:
    """Level, growth with curvature and growth with speed, none below 0.

    The mean of |e| is √(2/π) σ, so that least squares of |e| give σ.
    """
    away = np.abs(residual[use])
    away = np.minimum(away, _WINSOR * np.median(away)) / _MEAN_OF_HALF
    terms = (np.ones(len(away)), np.abs(samples.curvature[use]), np.abs(samples.speed[use]))
    design = np.column_stack(terms)
    level, per_curvature, per_speed = nnls(design, away)[0].tolist()
    return level, per_curvature, per_speed


def _between(medians: Floats, noise: Floats) -> float:
    """Standard deviation of a new session's mean about the line, which is 0."""
    count = len(medians)
    means = fit_mean(medians, noise, 0.0, 1.0)
    # Few sessions show less spread than there is.
    exceeded = 2.0 * float(gammaincinv(0.5 * (count - 1), 1.0 - _CONFIDENCE))  # by χ²
    open_yet = float(np.sqrt((count - 1) / exceeded))
    mean, variance = float(means.coefficients[0]), float(means.covariance[0, 0])
    return float(np.sqrt((open_yet * means.scatter) ** 2 + mean**2 + variance))


def _tails(samples: TrackingSamples, use: Bools, error: Floats, law: Spread) -> float:
    """Factor by which quantiles of the errors exceed those of the normal law [1]."""
    within = law.level + law.per_curvature * np.abs(samples.curvature[use])
    within += law.per_speed * np.abs(samples.speed[use])
    scaled = np.abs(error[use]) / np.maximum(np.hypot(within, law.between), 1e-9)
    independent = float(_blocks_by_session(samples)[np.unique(samples.session[use])].sum())
    farthest = 1.0 - _BEYOND / max(independent, 2.0 * _BEYOND)
    levels = 1.0 - np.geomspace(0.5, 1.0 - farthest, 8)
    normal = ndtri(0.5 + 0.5 * levels)
    return max(float(np.max(np.quantile(scaled, levels) / normal)), 1.0)


def _beyond(samples: TrackingSamples, rows: Bools, tracking: Tracking, quantile: float) -> float:
    """Share of samples beyond the band of a table [1]: across, or in heading where it is known."""
    errors = input_errors(tracking, quantile)
    band = errors.across(samples.curvature[rows])
    across = np.mean(np.abs(samples.cross_track[rows]) > band)
    heading = samples.heading[rows]
    turned = np.mean(np.abs(heading) > errors.heading) if np.isfinite(heading).all() else 0.0
    return float(max(across, turned))


def _blocks_by_session(samples: TrackingSamples) -> Floats:
    """Independent pieces of the way of each session, (sessions,) [1]."""
    counts = np.zeros(len(samples.sessions))
    block = np.floor(samples.travelled / _BLOCK)
    for session in range(len(counts)):
        counts[session] = len(np.unique(block[samples.session == session]))
    return counts
