"""How residual speeds of a stop hang together, and the transform that makes them independent.

A stop's speeds share more than white noise: the level at which it began, a slow change of the held
speed, a friction of its own, an onset of its own. Each is a random number a stop with a variance
that the log tells (restricted to what bins show). Friction is kept apart from the rest: it is what
all differences between stops have to be measured against.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import NUISANCES, Hypothesis
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.thresholds import (
    FORCE_STEP,
    LEAST_NOISE,
    LEVEL_STD,
    MOST_CORRELATED,
    NOISE_FLOOR,
    ONSET_STEP,
    RIDGE,
)
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations.

    Attributes:
        speed: of single samples [m/s]. correlation: of a bin with the one before it.
        creep: of the held speed's change [m/s²]. dead_time_std: of the onset [s].
        scatter: of F_b/W from stop to stop, in the median stop [1]; others in proportion.
        capped: a friction cap hides the scatter of what it cuts off.
    """

    speed: float
    correlation: float
    creep: float
    dead_time_std: float
    scatter: float
    capped: bool = True


@dataclass(frozen=True, slots=True)
class Whitener:
    """Linear maps from the grid to independent numbers of variance one.

    Attributes:
        bins: (S, K, K) from bins. grid: (S, K, M) from the grid.
        friction: (S, K) unit vectors along a change of each stop's friction.
        power: (S,) variance along it for a friction scatter of one.
        log_volume: (S,) log determinants of the covariance of bins, friction left out.
        noise: what it undoes.
    """

    bins: Floats
    grid: Floats
    friction: Floats
    power: Floats
    log_volume: Floats
    noise: Noise

    @property
    def weight(self) -> Floats:
        """(S,) by which what lies along the friction of a stop comes to a variance of one."""
        result: Floats = 1.0 / np.sqrt(1.0 + self.noise.scatter**2 * self.power)
        return result

    def rows(self, values: Floats) -> Floats:
        """(S + S K, P) columns (S, K, P) after `bins` or `grid`, all of variance one."""
        between, within = self.split(values)
        scaled = between * self.weight[:, None]
        return np.concatenate((scaled, within.reshape(-1, values.shape[2])))

    def by_stop(self, values: Floats) -> Floats:
        """(S, K + 1, P) the same, the friction of each stop first."""
        between, within = self.split(values)
        return np.concatenate(((between * self.weight[:, None])[:, None, :], within), axis=1)

    def split(self, values: Floats) -> tuple[Floats, Floats]:
        """Columns apart: along the friction of each stop, and the rest.

        Args:
            values: (S, K, P) after `bins` or `grid`.

        Returns:
            (S, P) with variance 1 + scatter² power; (S, K, P) with variance one.
        """
        between = np.einsum("sk,skp->sp", self.friction, values)
        return between, values - self.friction[:, :, None] * between[:, None, :]


def shapes(table: StopTable, hypothesis: Hypothesis, capped: bool = True) -> Floats:
    """(S, K, 4) change of the bins with level, creep, onset and friction of each stop.

    Onset and friction pass through whatever the hypothesis does to them: a lag delays a change of
    friction, a cap cuts it off.
    """
    since = table.time - hypothesis.dead_time
    later = replace(hypothesis, dead_time=hypothesis.dead_time + ONSET_STEP)
    here = predict(table, hypothesis)
    open_end = hypothesis
    if not capped:
        kept = tuple(e for e in hypothesis.added if LAWS[e.name].enters is not Enters.CAP)
        open_end = replace(hypothesis, added=kept)
    share = FORCE_STEP / max(float(np.median(table.force)), FORCE_STEP)
    friction = predict(table, open_end, stronger=share)
    friction = friction - (here if capped else predict(table, open_end))
    on_grid = np.stack(
        (
            np.ones_like(since),
            np.minimum(since, 0.0),
            (here - predict(table, later)) / ONSET_STEP,
            -friction / FORCE_STEP,
        ),
        axis=2,
    )
    result: Floats = table.average @ on_grid
    return result


def whitener(table: StopTable, noise: Noise, hypothesis: Hypothesis) -> Whitener:
    """The transform for a noise, by what a hypothesis makes of it."""
    own, used = _own(table, noise.correlation)
    effects = own @ shapes(table, hypothesis, noise.capped) / noise.speed
    std = np.array(
        [LEVEL_STD, max(noise.creep, NOISE_FLOOR[1]), max(noise.dead_time_std, NOISE_FLOOR[2])]
    )
    plain, volume = _inverse_root(effects[:, :, :3] * std)
    along = plain @ effects[:, :, 3:]
    power = np.einsum("skp,skp->s", along, along)
    bins = plain @ own / noise.speed
    volume = volume + 2.0 * used.sum(axis=1) * float(np.log(noise.speed))
    return Whitener(
        bins,
        bins @ table.average,
        along[:, :, 0] / np.sqrt(np.maximum(power, 1e-30))[:, None],
        power,
        volume,
        noise,
    )


def _own(table: StopTable, correlation: float) -> tuple[Floats, Bools]:
    """(S, K, K) that undoes the correlation and evens out the bins; zero for bins that are none."""
    used = table.spread > 0.0
    scale = np.where(used, 1.0 / np.sqrt(np.where(used, table.spread, 1.0)), 0.0)
    size = table.binned.shape[1]
    root = np.eye(size) - correlation * np.eye(size, k=-1)
    root[1:] /= np.sqrt(1.0 - correlation**2)
    return root * scale[:, None, :] * used[:, :, None], used


def _inverse_root(effects: Floats) -> tuple[Floats, Floats]:
    """(S, K, K) symmetric inverse roots of I + Z Zᵀ, (S,) log determinants of that."""
    q, r = np.linalg.qr(effects)
    values, vectors = np.linalg.eigh(r @ r.transpose(0, 2, 1))
    values = np.maximum(values, 0.0)
    axes = q @ vectors
    shrink = 1.0 / np.sqrt(1.0 + values) - 1.0
    root: Floats = np.eye(effects.shape[1]) + (axes * shrink[:, None, :]) @ axes.transpose(0, 2, 1)
    return root, np.sum(np.log1p(values), axis=1)


def estimate(
    table: StopTable, residual: Floats, hypothesis: Hypothesis, capped: bool = True
) -> Noise:
    """Maximum likelihood of all standard deviations.

    Args:
        table: stops. residual: (S, K) of the bins [m/s]. hypothesis: that left it.
        capped: see :class:`Noise`.
    """
    z = shapes(table, hypothesis, capped)
    fitted = len(hypothesis.free) - NUISANCES
    correlation = _correlation(table, residual, z)
    own, used = _own(table, correlation)
    z, r = own @ z, np.einsum("skj,sj->sk", own, residual)
    zz, zr = z.transpose(0, 2, 1) @ z, np.einsum("skp,sk->sp", z, r)
    rr, counts = float(np.sum(r * r)), float(used.sum())
    stops = len(table)

    def cost(logs: Floats) -> float:
        speed, creep, dead_time_std, scatter = np.exp(logs)
        precision = (
            np.array([1.0 / LEVEL_STD, 1.0 / creep, 1.0 / dead_time_std, 1.0 / scatter]) ** 2
        )
        inner = zz / speed**2 + np.diag(precision) + RIDGE * np.eye(4)
        solved = np.linalg.solve(inner, zr[:, :, None] / speed**2)[:, :, 0]
        quadratic = float(rr - np.sum(zr * solved)) / float(speed) ** 2
        logdet = counts * 2.0 * float(np.log(speed)) + float(np.sum(np.linalg.slogdet(inner)[1]))
        logdet -= stops * float(np.sum(np.log(precision)))
        # What was fitted to all stops took its share of their scatter along.
        logdet -= 2.0 * min(fitted, stops // 2) * float(np.log(scatter))
        lowest = np.log(np.array(NOISE_FLOOR))
        return quadratic + logdet + 10.0 * float(np.sum(np.maximum(lowest - logs, 0.0) ** 2))

    left = np.einsum("skj,sj->sk", own, residual)
    start = np.log(
        [
            max(
                1.4826
                * float(
                    np.median(
                        np.abs(
                            np.diff(
                                left[used.all(axis=1)] if used.all(axis=1).any() else left, axis=1
                            )
                        )
                    )
                )
                / np.sqrt(2.0),
                LEAST_NOISE,
            ),
            0.05,
            max(table.dead_time_std, 2e-3),
            0.01,
        ]
    )
    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.01})
    speed, creep, dead_time_std, scatter = (float(x) for x in np.exp(best.x))
    return Noise(max(speed, LEAST_NOISE), correlation, creep, dead_time_std, scatter, capped)


def _correlation(table: StopTable, residual: Floats, z: Floats) -> float:
    """Of neighbouring bins, once each stop's own numbers are fitted."""
    used = table.spread > 0.0
    scale = np.where(used, 1.0 / np.sqrt(np.where(used, table.spread, 1.0)), 0.0)
    z, r = z * scale[:, :, None], residual * scale
    inner = z.transpose(0, 2, 1) @ z
    # A cap may leave nothing of the friction of a stop.
    inner += (1e-9 * np.trace(inner, axis1=1, axis2=2)[:, None, None] + RIDGE) * np.eye(4)
    solved = np.linalg.solve(inner, np.einsum("skp,sk->sp", z, r)[:, :, None])
    left = r - (z @ solved)[:, :, 0]
    both = used[:, 1:] & used[:, :-1]
    top = float(np.sum(left[:, 1:] * left[:, :-1] * both))
    # Four numbers fitted to K bins make white residuals look anticorrelated.
    bias = z.shape[2] / float(np.median(used.sum(axis=1)))
    return float(np.clip(top / max(float(np.sum(left**2)), 1e-300) + bias, 0.0, MOST_CORRELATED))
