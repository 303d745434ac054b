"""Seconds of driving summarised by numbers that change with the ground, and by how it was driven.

The logarithm of the current's mean and of its fluctuation, the yaw rate that a difference of rim
speeds gets, and how much the body shakes about each axis in three bands of frequency, over the
speed of the wheels. They also change with the way of driving, so that seconds are compared only
with seconds of the same condition: straight, turn or turn on the spot, and octaves of speed. What
is left of the difference in driving, in speed, curvature and slope, excuses some of theirs.

Source: none for the features; that terrains shake a vehicle each in their own way is Slip [7].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from slopewise.models.arrays import Floats

Condition = tuple[str, int]

_BANDS = ((1.5, 8.0), (8.0, 20.0), (20.0, 50.0))  # [Hz]
_LEAST = 5  # samples in a window
_NO_CURRENT = 0.3  # [A] added before the logarithm
_NO_SHAKING = 1e-4  # [rad/s] likewise
_SPEED_STEPS = 1.5  # conditions an octave of rim speed

# Usual spread from second to second on one ground: what is assumed before a log tells.
_SPREAD_CURRENT, _SPREAD_FLUCTUATION, _SPREAD_TURNING = 0.15, 0.40, 0.15
_SPREAD_BANDS = (0.40, 0.35, 0.35)
"""The same, of the three vibration bands [1]."""

# What a difference in driving may do to a channel, as a standard deviation: per unit of the speed's
# logarithm, of the share of turning (0 straight, 1 on the spot), of the slope.
_BY_DRIVING_CURRENT = (0.5, 2.0, 5.0)
_BY_DRIVING_TURNING = (0.3, 1.0, 2.0)
"""The same, of the yaw-rate gain."""
_BY_DRIVING_SHAKING = (0.5, 1.0, 3.0)
"""The same, of vibration."""


@dataclass(frozen=True, slots=True)
class SteadySecond:
    """A second of steady driving.

    Attributes:
        condition: how it was driven.
        channels: (channels,) what the ground did to it.
        driving: (3,) logarithm of the rim speed, share of turning, slope in the direction of travel
            [rad]: how it was driven within the condition.
    """

    condition: Condition
    channels: Floats
    driving: Floats


def usual_spread(rates: int) -> Floats:
    """(channels,) standard deviation of each channel with so many turn rates."""
    body = [_SPREAD_CURRENT, _SPREAD_FLUCTUATION, _SPREAD_TURNING]
    return np.array(body + list(_SPREAD_BANDS) * rates)


def by_driving(rates: int) -> Floats:
    """(channels, 3) change of each channel with the driving, see :class:`SteadySecond`."""
    body = [_BY_DRIVING_CURRENT, _BY_DRIVING_CURRENT, _BY_DRIVING_TURNING]
    return np.array(body + [_BY_DRIVING_SHAKING] * (len(_BANDS) * rates))


def summarise(samples: Floats, least_rim_speed: float, turn_begin: float) -> SteadySecond | None:
    """A window out of its samples, None unless it was driven steadily.

    Args:
        samples: (n, 6 + rates) v_left, v_right [m/s], currents left and right [A], pitch [rad], yaw
            rate and further rates of turn [rad/s], evenly in time over one second.
        least_rim_speed: slower wheels do not count as driving [m/s].
        turn_begin: difference of rim speeds that is a turn [m/s].
    """
    if len(samples) < _LEAST:
        return None
    means, spreads = samples.mean(axis=0), samples[:, :2].std(axis=0)
    left, right = float(means[0]), float(means[1])
    rim = max(abs(left), abs(right))
    if rim < least_rim_speed or float(spreads.sum()) > 0.1 * rim + 0.01:
        return None
    difference = right - left
    turning = abs(difference) >= turn_begin
    kind = "straight" if not turning else "spot" if left * right < 0.0 else "turn"
    current = np.abs(samples[:, 2:4]).sum(axis=1)
    achieved = float(means[5]) / difference if turning else 0.0
    channels = [
        math.log(_NO_CURRENT + float(current.mean())),
        math.log(_NO_CURRENT + float(current.std())),
        min(max(achieved, -0.5), 3.0),
        *_shaking(samples[:, 5:] - means[5:], rim),
    ]
    slope = -math.copysign(float(means[4]), float(means[4]) * (left + right))
    driving = np.array([math.log(rim), abs(difference) / (2.0 * rim), slope])
    return SteadySecond((kind, round(_SPEED_STEPS * math.log2(rim))), np.array(channels), driving)


def _shaking(rates: Floats, rim: float) -> Floats:
    """Log of the amplitude in each band of each rate over the rim speed; NaN beyond Nyquist.

    Args:
        rates: (n, rates) about their means, over one second: line k of the spectrum is k Hz.
        rim: speed of the wheels [m/s].
    """
    amplitudes = band_amplitudes(rates, _BANDS)
    return np.asarray(np.log((amplitudes + _NO_SHAKING) / rim).ravel())


def band_amplitudes(deviations: Floats, bands: Sequence[tuple[float, float]]) -> Floats:
    """(channels, bands) root mean square of each channel in each band; NaN beyond Nyquist.

    Args:
        deviations: (n, channels) about their means, over one second: line k of the spectrum is
            k Hz.
        bands: lowest and highest frequency of each [Hz].
    """
    count = len(deviations)
    spectrum = np.fft.rfft(deviations * _taper(count), axis=0)
    power = (spectrum.real**2 + spectrum.imag**2) / count
    amplitudes = np.full((deviations.shape[1], len(bands)), math.nan)
    for index, (low, high) in enumerate(bands):
        if 2.0 * high <= count + 1.0:
            band = power[math.ceil(low) : math.floor(high) + 1]
            amplitudes[:, index] = np.sqrt(np.add.reduce(band) / len(band))
    return amplitudes


@lru_cache(maxsize=16)
def _taper(count: int) -> Floats:
    return np.hanning(count)[:, None]
