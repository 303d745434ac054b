"""Speeds of all stops as independent numbers of variance one, by the covariance of the likelihood.

The own effects of each stop are in its covariance. Nuisances that stops
share, while brakes and body settle and in each session, are projected out as far as their prior
allows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.marginal import with_onset
from slopewise.models.discrepancy.likelihood.onset import Onset
from slopewise.models.discrepancy.likelihood.trace import (
    EARLY_PLACES,
    HAT_PLACES,
    OSCILLATION_PLACES,
    Trace,
    columns_at,
)
from slopewise.models.quantity import GRAVITY

_WAVE = 4.0 / np.pi**2
"""Change of a stop by half a cosine wave of the force, over that by a constant one: ∫∫ of both."""


@dataclass(frozen=True, slots=True)
class Whitener:
    """Linear map from bins to independent numbers, at one state of onset and noise.

    Attributes:
        root: (S, K, K) of each stop. nuisances: (S, K, N) after it, in units of their deviations.
        basis: (S K + N, N) orthonormal, of the nuisances with their prior.
        small: (S, K, Q) small versions of all effects after it, in units of their deviations.
        variance: (S, K) of the speeds about a perfect model, level and ramp apart [m²/s²].
        onset, noise: state; noise as :data:`slopewise.models.discrepancy.likelihood.prior.NOISE`.
        force: typical F_b/W [1].
    """

    root: Floats
    nuisances: Floats
    basis: Floats
    small: Floats
    variance: Floats
    onset: Onset
    noise: Floats
    force: float

    @classmethod
    def of(cls, trace: Trace, onset: Onset, noise: Floats, *, lagging: bool = False) -> Whitener:
        """Of a log.

        Args:
            trace: columns of the log. onset: its state. noise: (6,) as in the prior.
            lagging: the model has the build-up of the brakes; else it is a later onset there, and
                the difference between both is a nuisance.
        """
        every, per_stop, std = columns_at(trace, onset)
        spread, scaled = trace.table.spread, with_onset(std, noise)
        used = spread > 0.0
        variance = prior.own_variance(noise, per_stop.shape[2])
        per_stop = per_stop * used[:, :, None]
        alone = noise[0] ** 2 * np.where(used, spread, 1.0)
        covariance = (per_stop * variance) @ np.swapaxes(per_stop, 1, 2)
        covariance += alone[:, :, None] * np.eye(alone.shape[1])
        root = np.linalg.inv(np.linalg.cholesky(covariance)) * used[:, None, :]
        # Coefficients have to absorb all other unmodelled effects: predictions have nothing else.
        sessions = slice(EARLY_PLACES.stop, EARLY_PLACES.stop + trace.sessions)
        places = np.r_[OSCILLATION_PLACES, HAT_PLACES, EARLY_PLACES, sessions]
        spikes = slice(sessions.stop, len(std))
        columns = [every[:, :, places] * scaled[places]]
        if not lagging:
            u = trace.samples.time - onset.dead_time
            late = np.maximum(u, 0.0) - onset.missing(u) - np.maximum(u - onset.build_up, 0.0)
            columns.append((trace.pull * trace.samples.mean(late))[:, :, None])
        nuisances = root @ np.concatenate(columns, axis=2)
        # No model predicts the level of a stop, and its ramp.
        beyond = per_stop[:, :, prior.LEVELS :] ** 2 @ variance[prior.LEVELS :]
        small = root @ (every[:, :, spikes] * scaled[spikes])
        basis, variance = _basis(nuisances), beyond + alone
        return cls(root, nuisances, basis, small, variance, onset, noise, trace.force)

    def rows(self, values: Floats) -> Floats:
        """(S K + N, P) independent rows of bins (S, K, P)."""
        return self._projected(self.root @ values)

    def unmodelled(self) -> Floats:
        """(S K + N, Q) rows of a small version of each effect, in units of its deviation."""
        return self._projected(self.small)

    def _projected(self, whitened: Floats) -> Floats:
        flat = whitened.reshape(-1, whitened.shape[2])
        taken = self.basis @ (self.basis[: len(flat)].T @ flat)
        taken[: len(flat)] -= flat
        return -taken

    def take(self, stops: Bools) -> Whitener:
        """Of some of the stops, (S,)."""
        nuisances = self.nuisances[stops]
        return replace(
            self,
            root=self.root[stops],
            nuisances=nuisances,
            basis=_basis(nuisances),
            small=self.small[stops],
            variance=self.variance[stops],
        )

    @property
    def scatter(self) -> float:
        """Force from stop to stop, as a share of it [1]."""
        return float(self.noise[1])

    @property
    def force_std(self) -> float:
        """F_b/W from stop to stop, constant along each, that changes stops as all scatter does."""
        return float(np.hypot(self.scatter, _WAVE * self.noise[prior.WAVE])) * self.force

    @property
    def dead_time_std(self) -> float:
        """Of the dead time from stop to stop [s]."""
        return float(self.noise[2])

    def distance_variance(self, held: Floats, pull: Floats) -> Floats:
        """(S,) of stopping distances about a perfect model [m²].

        Args:
            held: (S,) speed before the command [m/s]. pull: (S,) brakes and ground, share of the
                weight.
        """
        by_force = self.force_std * held**2 / (2.0 * GRAVITY * pull**2)
        variance: Floats = by_force**2 + (self.dead_time_std * held) ** 2
        return variance


def _basis(nuisances: Floats) -> Floats:
    count = nuisances.shape[2]
    rows = np.concatenate((nuisances.reshape(-1, count), np.eye(count)))
    return np.asarray(np.linalg.qr(rows)[0], np.float64)
