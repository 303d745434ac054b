"""Slip track from yaw rate and rim speeds: a scalar Kalman filter on x = 1/B_s.

x walks at random, and ω_z = ΔV x + noise. The filter runs in turns only: on straights ΔV is 0 and
shows no slip. It follows x and not B_s because the yaw rate is the noisy one of the two.

Validity: wheels that move the vehicle. Of a stuck vehicle with spinning wheels the yaw rate says
B_s → ∞, which is no property of the ground: such samples belong outside (:mod:`.phases`).
Omits: noise of the rim speeds, as print does. Source: Slip (4)–(11).
"""

from __future__ import annotations

import math

from slopewise.models.terrain.settings import FilterSettings


class SlipTrackFilter:
    """State x = 1/B_s [1/m] and its variance [1/m²], updated sample by sample."""

    def __init__(self, slip_track: float, settings: FilterSettings | None = None) -> None:
        """Begin at a slip track B_s > 0 [m]; the paper's settings by default."""
        settings = FilterSettings() if settings is None else settings
        self.inverse = 1.0 / slip_track
        self.variance = settings.initial_std**2
        self._noise = settings.yaw_rate_std**2
        self._growth = settings.process_variance / settings.sample_time

    def update(self, speed_difference: float, yaw_rate: float, elapsed: float) -> None:
        """One sample of a turn. Source: Slip (7)–(11) with A = 1, B = 0.

        ``speed_difference``: ΔV = V_R − V_L [m/s]. ``yaw_rate``: ω_z without bias [rad/s].
        ``elapsed``: time since the sample before [s]; Q grows with it, for logs of any rate.
        """
        predicted = self.variance + self._growth * elapsed
        innovation_variance = speed_difference * speed_difference * predicted + self._noise
        gain = predicted * speed_difference / innovation_variance
        self.inverse += gain * (yaw_rate - speed_difference * self.inverse)
        # (1 − K H) P written without the difference, which could round below zero
        self.variance = predicted * self._noise / innovation_variance

    @property
    def slip_track(self) -> float:
        """B_s [m]; infinite where no turning is left, x ≤ 0."""
        return 1.0 / self.inverse if self.inverse > 0.0 else math.inf

    @property
    def slip_track_std(self) -> float:
        """Standard deviation of B_s [m], to first order: B_s² times that of 1/B_s."""
        if self.inverse <= 0.0:
            return math.inf
        return math.sqrt(self.variance) / (self.inverse * self.inverse)


def steady_state_variance(
    speed_difference: float, settings: FilterSettings | None = None
) -> tuple[float, float]:
    """Variances (before, after a sample) [1/m²] that the filter settles to.

    The root of the scalar Riccati equation P = P R/(H² P + R) + Q, before a sample:
    P = (Q + √(Q² + 4 Q R/H²))/2, and P − Q after it. With print's Q and R, 0.0025 m⁻² before a
    sample belongs to ΔV = 1.2 m/s. Source: Slip (8), (9), (11); print gives the unit as m².
    ``speed_difference``: ΔV, the same in every sample, not 0 [m/s].
    """
    settings = FilterSettings() if settings is None else settings
    Q, R = settings.process_variance, settings.yaw_rate_std**2
    before = 0.5 * (Q + math.sqrt(Q * Q + 4.0 * Q * R / speed_difference**2))
    return before, before - Q
