"""Traces of all stops at one state of the onset: columns of all explanations, and residuals.

Always there: coefficients as deviations from the model file, sessions, nuisances of the onset and a
small version of every smooth effect (spike), since nothing is exactly zero in nature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import MIN_PULL, StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.gaussian import Grams
from slopewise.models.discrepancy.likelihood.onset import Integrated, Moment, Onset, Samples
from slopewise.models.discrepancy.model.brakes import brought_force, motion_of
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import demanded_force, moved_share
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY

HATS = (0.0, 0.05, 0.11, 0.19, 0.29, 0.42)
"""Middles of the hats over the onset, since it [s]: denser where the brakes take hold."""
ONSET, WAVES = 0.6, 5  # in which brakes and body settle [s]; waves of a force, there and along axes
OSCILLATION_PLACES = slice(3, 5)
"""Where the swing of the body is among the columns that are always there."""
HAT_PLACES = slice(6, 6 + len(HATS))
"""Where the hats are."""
BASE_PLACES = slice(HAT_PLACES.stop, HAT_PLACES.stop + 4)
"""Where the coefficients are."""
EARLY_PLACES = slice(HAT_PLACES.stop + 4, HAT_PLACES.stop + 4 + WAVES)
"""Where the waves of the force after the onset are."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Columns of a log, the same for every onset.

    Attributes:
        table: S stops. model: as configured. samples: those of its bins.
        speed: (S, K) mean in them.
        expected: forces of the model file: force of the brakes; gravity and terms of motion.
        always: (…, P) of the base, sessions and spikes. waves: (…, W) slow ones of the force.
        always_std: (P,) prior deviations of `always`.
        pull: (S, 1) deceleration that each stop shows [m/s²]. force: typical F_b/W [1].
        calibrated: (4,) prior deviations of coefficients that are as in the file.
        sessions: number of columns that sessions have, the first ones of `always` after the waves
            of the onset.
        used: (S, M) whether a grid time lies in the stop after the onset.
    """

    table: StopTable
    model: Model
    samples: Samples
    speed: Floats
    expected: Integrated
    always: Integrated
    waves: Integrated
    always_std: Floats
    pull: Floats
    force: float
    calibrated: Floats
    sessions: int
    used: Floats


def base_shares(table: StopTable) -> Floats:
    """(S, M, 4) of the coefficients: level force and slope, at the mean onset speed and with it."""
    constant = np.ones_like(table.grade)
    speed = (table.held - table.held.mean())[:, None] * constant
    return np.stack([constant, table.grade, speed, speed * table.grade], axis=2)


def projected(shares: Floats, base: Floats, used: Floats) -> Floats:
    """(S, M, Q) without what the base can do, by least squares while braking."""
    weight = used.ravel()[:, None]
    flat, onto = shares.reshape(-1, shares.shape[2]), base.reshape(-1, base.shape[2])
    inner = (onto * weight).T @ onto + 1e-9 * np.eye(onto.shape[1])
    left: Floats = (flat - onto @ np.linalg.solve(inner, (onto * weight).T @ flat)).reshape(
        shares.shape
    )
    return left


def size_of(shares: Floats, used: Floats) -> Floats:
    """(Q,) root mean square while braking."""
    size: Floats = np.sqrt(np.einsum("smq,sm->q", shares**2, used) / used.sum())
    return size


def spread_of(shares: Floats, used: Floats) -> Floats:
    """(Q,) the same without their mean, which the level force takes."""
    return size_of(shares - np.einsum("smq,sm->q", shares, used) / used.sum(), used)


def trace_of(table: StopTable, model: Model, spikes: tuple[Floats, Floats]) -> Trace:
    """The trace of a log.

    Args:
        table: S stops. model: as configured.
        spikes: (S, M, Q) shares of smooth effects, (Q,) whether brakes bring them.
    """
    used = ((table.time > table.onset) & (table.speed > 0.0)).astype(np.float64)
    force = max(float(np.median(table.force)), MIN_PULL)
    always, std = _always(table, used, force, spikes)
    along = np.clip((table.time - table.onset) / (table.time[:, -1:] - table.onset), 0.0, 1.0)
    waves = [np.cos(np.pi * j * along) for j in range(WAVES + 1)]
    slow = np.stack(waves, axis=2) * np.maximum(table.force, MIN_PULL)[:, None, None]
    return Trace(
        table,
        model,
        Samples.of(table),
        (table.average @ table.speed[:, :, None])[:, :, 0],
        _expected(table, model),
        always,
        Integrated.of(table, slow, np.ones(len(waves), bool)),
        std,
        GRAVITY * table.pull[:, None],
        force,
        prior.calibrated(force, table.held.mean(), model.braking.covariance),
        len(std) - EARLY_PLACES.stop + BASE_PLACES.start - spikes[0].shape[2],
        used,
    )


def _expected(table: StopTable, model: Model) -> Integrated:
    """Force of the brakes by the model file; gravity and its terms of motion."""
    configured = Hypothesis.configured(model)
    force = demanded_force(table, configured, table)
    given = brought_force(table, configured, force, table.speed, table, table.time).given
    moved = np.sin(table.grade) + moved_share(table.speed, table, motion_of(configured))
    return Integrated.of(table, np.stack([given, moved], axis=2), np.array([True, False]))


def _always(
    table: StopTable, used: Floats, force: float, spikes: tuple[Floats, Floats]
) -> tuple[Integrated, Floats]:
    """Coefficients, waves of the onset (deviation 1), sessions, spikes; (P,) prior deviations."""
    base = base_shares(table)
    since = np.clip(table.time - table.onset, 0.0, ONSET) / ONSET
    early = np.stack([np.cos(np.pi * j * since) for j in range(1, WAVES + 1)], axis=2)
    early = projected(early, base, used)
    early *= force / size_of(early, used)
    on_day = [table.session == s for s in np.unique(table.session)]
    days = [on - np.mean(on) for on in on_day]
    days = days if len(days) > 1 else []
    ones = np.ones_like(table.time)
    by_day = np.stack([force * d[:, None] * ones for d in days], axis=2) if days else base[:, :, :0]
    size = np.maximum(spread_of(spikes[0], used), 1e-12)
    smooth = projected(spikes[0], base, used) / size
    shares = np.concatenate([base, early, by_day, smooth], axis=2)
    std = [prior.changed(force), np.ones(WAVES), np.full(len(days), prior.SESSION)]
    # Losses by v and by v² are nearly the same: both together are as large as one would be alone.
    unit = smooth / np.maximum(size_of(smooth, used), 1e-3)
    correlation = np.einsum("smq,smr,sm->qr", unit, unit, used, optimize=True) / used.sum()
    shared = np.maximum(np.sum(correlation**2, axis=1), 1.0)
    std.append(prior.SPIKE * force / np.sqrt(shared))
    through = np.append(np.ones(shares.shape[2] - len(size), np.bool_), spikes[1])
    return Integrated.of(table, shares, through), np.concatenate(std)


def grams_at(trace: Trace, onset: Onset, extra: Integrated) -> tuple[Grams, Floats]:
    """Products of :func:`columns_at`, and (P,) deviations of those always there, hats as 1."""
    every, per_stop, std = columns_at(trace, onset, extra)
    return Grams.of(every, per_stop, trace.table.spread), std


def columns_at(
    trace: Trace, onset: Onset, extra: Integrated | None = None
) -> tuple[Floats, Floats, Floats]:
    """Columns of all stops (S, K, P + Q + 1), of each stop (S, K, R), and (P,) deviations.

    The first column is that of the dead time, the last what is to be explained.

    Args:
        trace: that of the log. onset: its state. extra: (…, Q) shares of further columns.
    """
    table, samples = trace.table, trace.samples
    moment = Moment.of(samples, onset)
    always, stds = _nuisances(trace, onset, moment)
    early = samples.mean(np.minimum(moment.u, 0.0))
    expected = trace.expected.fallen(table, onset, moment).sum(axis=2)
    left = table.binned - table.held[:, None] + expected
    shares = (trace.always,) if extra is None else (trace.always, extra)
    columns = [-c.fallen(table, onset, moment) for c in shares]
    every = np.concatenate([np.stack(always, axis=2), *columns, left[:, :, None]], axis=2)
    per_stop = np.stack([np.ones_like(early), early, always[0]], axis=2)
    per_stop = np.concatenate([per_stop, trace.waves.fallen(table, onset, moment)], axis=2)
    return every, per_stop, np.concatenate([stds, trace.always_std])


def _nuisances(trace: Trace, onset: Onset, moment: Moment) -> tuple[list[Floats], Floats]:
    """(S, K) each of the onset, the first one of the dead time, and (N,) their deviations."""
    u, mean, pull = moment.u, trace.samples.mean, trace.pull
    rates, changes, behind = (mean(x) for x in onset.oscillated(u))
    hats = [
        pull * mean(np.maximum(1.0 - np.abs(u - middle) / width, 0.0))
        for middle, width in zip(HATS, np.diff(HATS, prepend=-HATS[1]), strict=True)
    ]
    t = trace.samples.time
    early = -GRAVITY * mean(np.clip(t, 0.0, max(onset.dead_time, 0.0)))
    built = pull * mean(onset.built(u))
    stds = [prior.DEAD_TIME_STEP, prior.AT_ONSET, prior.AT_ONSET]
    stds += [prior.BODY, prior.BODY_SHIFT, prior.BODY]
    columns = [built, -trace.speed * built / GRAVITY, early, pull * rates, pull * changes]
    columns += [GRAVITY * pull * behind, *hats]
    return columns, np.array([*stds, *[1.0] * len(HATS)])
