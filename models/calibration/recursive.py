"""Recursive least squares of the four coefficients, with directional forgetting.

Each stop is one observation of F_b/W = [v θ, θ, v, 1] · [m_m, b_m, m_b, b_b]. Old stops
are forgotten only in the directions that new stops excite: hours on level ground leave the slope
coefficients unchanged. Plain exponential forgetting would let them drift with the noise.

Source: Braking Sec. 4.2 asks for an online estimator; forgetting without windup after Stenlund and
Gustafsson, Avoiding windup in recursive parameter estimation, 2002.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from slopewise.models.arrays import Floats

_SLOPE = 0.02
"""Lowest grade at which a stop carries information on the slope coefficients [rad]."""

_FADING = 0.9
"""Decay per accepted stop of the evidence that rejected stops gave on slope coefficients [1]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecursiveSettings:
    """Settings of the estimator.

    Attributes:
        scatter: standard deviation of F_b/W from stop to stop, without measurement noise [1].
        steady: standard deviations of the coefficients after many stops [s/m, 1, s/m, 1]; with
            the scatter of stops they give a memory of about ten stops.
        gate: innovation beyond which a single stop is rejected [standard deviations].
        weaker, stronger: consecutive rejected stops, all weaker or all stronger than expected,
            after which a change of brakes or surface is assumed [1].
        change: standard deviation that a change adds to F_b/W, on top of the first covariance.
        min_speed: slower stops are too short to learn from [m/s].
    """

    scatter: float = 0.01
    steady: tuple[float, float, float, float] = (0.003, 0.010, 0.001, 0.003)
    gate: float = 4.0
    weaker: int = 2
    stronger: int = 4
    change: float = 0.0
    min_speed: float = 0.5


class Acceptance(Enum):
    """Outcome of the update with one stop."""

    ACCEPTED = "accepted"
    GATED = "rejected: too far from what was expected"
    CHANGED = "accepted after several like it: brakes or ground have changed"
    UNINFORMATIVE = "too slow, or no number"


class RecursiveForce:
    """Coefficients m_m, b_m, m_b, b_b with covariance, one stop at a time.

    Args:
        coefficients: initial values, (4,). covariance: theirs, (4, 4).
        settings: settings of the estimator.

    Attributes:
        accepted, gated: number of accepted and rejected stops. inflate_next: before the next stop.
        row: streak of rejected stops, > 0: stronger than expected, < 0: weaker.
    """

    def __init__(
        self, coefficients: Floats, covariance: Floats, settings: RecursiveSettings | None = None
    ) -> None:
        self.settings = settings or RecursiveSettings()
        self.coefficients: Floats = np.array(coefficients, np.float64)
        self.covariance: Floats = np.array(covariance, np.float64)
        self.accepted = self.gated = 0
        self._first_covariance = self.covariance.copy()
        self._steady = np.diag(np.square(self.settings.steady))
        self.inflate_next = False
        self.row = 0
        self._signed_sum = 0.0

    def update(self, speed: float, grade: float, force_ratio: float, std: float) -> Acceptance:
        """Update with one stop.

        Args:
            speed: v_i [m/s]. grade: mean θ [rad]. force_ratio: F_b/W. std: its measurement noise.
        """
        s = self.settings
        finite = math.isfinite(speed + grade + force_ratio + std)
        if not finite or speed < s.min_speed or std < 0.0:
            return Acceptance.UNINFORMATIVE
        x = np.array([speed * grade, grade, speed, 1.0])
        noise = std * std + s.scatter * s.scatter
        if self.inflate_next:
            self._open()
        seen = self.covariance @ x
        innovation = force_ratio - float(x @ self.coefficients)
        expected = float(x @ seen) + noise
        outcome = Acceptance.ACCEPTED
        if innovation * innovation > s.gate * s.gate * expected:
            if not self._persists(innovation, grade):
                self.gated += 1
                return Acceptance.GATED
            self._open()
            seen = self.covariance @ x
            expected = float(x @ seen) + noise
            outcome = Acceptance.CHANGED
        self.row = 0
        self._signed_sum *= _FADING
        self.accepted += 1
        self.coefficients = self.coefficients + seen * (innovation / expected)
        gain_row = self._steady @ x
        again = np.outer(gain_row, gain_row) / (float(x @ gain_row) + noise)
        self.covariance = self.covariance - np.outer(seen, seen) / expected + again
        return outcome

    def _persists(self, innovation: float, grade: float) -> bool:
        """Whether the streak of similar rejected stops is long enough for a change.

        Similar are also stops that deviate to one side uphill and to the other downhill: otherwise
        wrong slope coefficients would never recover where uphill and downhill alternate.
        """
        side = math.copysign(1.0, innovation * grade) if abs(grade) > _SLOPE else 0.0
        if side:
            self._signed_sum = self._signed_sum + side if self._signed_sum * side > 0.0 else side
        has_drifted = abs(self._signed_sum) >= self.settings.stronger
        if innovation < 0.0:
            self.row = min(self.row, 0) - 1
            return -self.row >= self.settings.weaker or has_drifted
        self.row = max(self.row, 0) + 1
        return self.row >= self.settings.stronger or has_drifted

    def inflate(self) -> None:
        """Inflate the covariance before the next stop, as after a change; restart the counts."""
        self.inflate_next = True
        self.accepted = self.row = 0

    def _open(self) -> None:
        """Inflate the covariance for a change of brakes or surface."""
        self.covariance = self.covariance + self._first_covariance
        self.covariance[3, 3] += self.settings.change**2
        self.inflate_next, self._signed_sum = False, 0.0

    def age(self, seconds: float, time_constant: float) -> None:
        """Grow the covariance towards the first one with the age of the estimate [s]."""
        share = -math.expm1(-max(seconds, 0.0) / time_constant)
        grown = at_least_both(self.covariance, self._first_covariance)
        self.covariance = self.covariance + share * (grown - self.covariance)


def at_least_both(first: Floats, second: Floats) -> Floats:
    """A covariance (n, n) that is nowhere below either of two: A + the positive part of B − A."""
    values, vectors = np.linalg.eigh(second - first)
    return np.asarray(first + (vectors * np.maximum(values, 0.0)) @ vectors.T)
