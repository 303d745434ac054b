"""How brakes take hold, and columns of speed in integral form after it.

v(t) = v_i − g ∫ (φ_at_once + φ_brakes c) dt with c = 1 − e^(−u/τ), u the time since the onset. Only
shares φ of the weight enter; nothing is differentiated. Everything near the onset is computed at
the samples themselves, since a grid of times would move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import bilinear, lfilter

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.prediction import at_time
from slopewise.models.quantity import GRAVITY

OSCILLATION, DAMPING = 2.5, 0.3  # of a typical sprung body [Hz], [1]
_FINE = 0.004  # step at which the oscillation is computed [s]: a fiftieth of its shortest period


@dataclass(frozen=True, slots=True)
class Onset:
    """State of all that happens while the brakes take hold.

    Attributes:
        dead_time: from the command to the onset [s]. build_up: time constant of the brakes [s].
        oscillation, damping: natural frequency [Hz] and damping [1] of the sprung body,
            typical by default.
    """

    dead_time: float
    build_up: float
    oscillation: float = OSCILLATION
    damping: float = DAMPING

    def built(self, u: Floats) -> Floats:
        """Share of the force that is built up at times since the onset."""
        rise: Floats = -np.expm1(-np.maximum(u, 0.0) / self.build_up)
        return rise

    def missing(self, u: Floats) -> Floats:
        """∫ (1 − c) du since the onset [s]."""
        return self.build_up * self.built(u)

    def oscillated(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Rate, its change, and ∫ (c − state) du of a sprung body that follows c."""
        since = np.arange(0.0, max(float(u.max()), 0.0) + 2.0 * _FINE, _FINE)
        pulse = 2.0 * np.pi * self.oscillation
        twice = 2.0 * self.damping * pulse
        rate_of_force = bilinear([pulse**2, 0.0], [1.0, twice, pulse**2], 1.0 / _FINE)
        rates = lfilter(*rate_of_force, self.built(since))
        changes = np.gradient(rates, _FINE)
        # From its equation of motion: ω² (c − state) = change + 2 ζ ω rate, integrated.
        behind = (rates + twice * np.cumsum(rates) * _FINE) / pulse**2
        rate, change, left = (np.interp(u, since, x, left=0.0) for x in (rates, changes, behind))
        return rate, change, left


@dataclass(frozen=True, slots=True)
class Samples:
    """Times of the samples in each bin.

    Attributes:
        time: (S, K, J) since the command [s]. weight: (S, K, J) of each in the mean of its bin.
    """

    time: Floats
    weight: Floats

    @classmethod
    def of(cls, table: StopTable) -> Samples:
        """Evenly about the middle of each bin: a bin has as many as its variance says."""
        spread = table.spread
        count = np.where(spread > 0.0, np.round(1.0 / np.where(spread > 0.0, spread, 1.0)), 0.0)
        place = np.arange(max(int(count.max()), 1))
        middle = (table.average @ table.time[:, :, None])[:, :, 0]
        offset = (place - 0.5 * (count[:, :, None] - 1.0)) * table.sample
        inside = place < count[:, :, None]
        weight = inside / np.maximum(count, 1.0)[:, :, None]
        return cls(middle[:, :, None] + np.where(inside, offset, 0.0), weight)

    def mean(self, values: Floats) -> Floats:
        """(S, K) means over bins of values (S, K, J)."""
        result: Floats = np.einsum("skj,skj->sk", values, self.weight)
        return result


@dataclass(frozen=True, slots=True)
class Moment:
    """An onset at all samples.

    Attributes:
        u: (S, K, J) since the onset [s]. after: (S, K, 1) whether a whole bin is after it.
        since, missing: (S, K, 1) means of u, 0 before the onset, and of the force not built up [s].
    """

    u: Floats
    after: Bools
    since: Floats
    missing: Floats

    @classmethod
    def of(cls, samples: Samples, onset: Onset) -> Moment:
        """Of an onset."""
        u = samples.time - onset.dead_time
        return cls(
            u,
            (u[:, :, :1] >= 0.0),
            samples.mean(np.maximum(u, 0.0))[:, :, None],
            samples.mean(onset.missing(u))[:, :, None],
        )


@dataclass(frozen=True, slots=True)
class Integrated:
    """Shares of the weight, integrated once for all onsets.

    Attributes:
        shares, integral: (S, M, Q) shares and their integral over time [s]. mean: (S, K, Q) of the
            integral over bins. through: (Q,) whether brakes bring them.
    """

    shares: Floats
    integral: Floats
    mean: Floats
    through: Bools

    @classmethod
    def of(cls, table: StopTable, shares: Floats, through: Bools) -> Integrated:
        """Shares (S, M, Q), and (Q,) whether brakes bring them."""
        step = (table.time[:, 1:2] - table.time[:, :1])[:, :, None]
        total = np.zeros_like(shares)
        np.cumsum(0.5 * step * (shares[:, 1:] + shares[:, :-1]), axis=1, out=total[:, 1:])
        return cls(shares, total, table.average @ total, np.asarray(through, np.bool_))

    def take(self, index: Sequence[int]) -> Integrated:
        """Some of the columns."""
        i = list(index)
        return Integrated(
            self.shares[:, :, i], self.integral[:, :, i], self.mean[:, :, i], self.through[i]
        )

    def joined(self, other: Integrated) -> Integrated:
        """These columns and those of another one."""
        each = ((self.shares, other.shares), (self.integral, other.integral))
        shares, integral = (np.concatenate(columns, axis=2) for columns in each)
        mean = np.concatenate((self.mean, other.mean), axis=2)
        return Integrated(shares, integral, mean, np.append(self.through, other.through))

    def fallen(self, table: StopTable, onset: Onset, moment: Moment) -> Floats:
        """(S, K, Q) what they take from the speed by each bin [m/s].

        Until the brakes are built up a share has its value at the onset: exact for those that
        change slowly compared with the build-up.
        """
        share = at_time(self.shares, table.time, onset.dead_time)
        fall: Floats = self.mean - at_time(self.integral, table.time, onset.dead_time)[:, None]
        stop, early = np.nonzero(~moment.after[:, :, 0])
        fall[stop, early] = moment.since[stop, early] * share[stop]
        fall -= moment.missing * np.where(self.through, share, 0.0)[:, None]
        fall *= GRAVITY
        return fall
