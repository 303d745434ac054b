"""Seconds of driving summarised by numbers that change with the ground, and by how it was driven.

The logarithm of the current's mean and of its fluctuation, the yaw rate that a difference of rim
speeds gets, and how much the body shakes about each axis in three bands of frequency, over the
speed of the wheels. They also change with the way of driving, so that seconds are compared only
with seconds of the same condition: straight, turn or turn on the spot, and octaves of speed.

Source: none for the features; that terrains shake a vehicle each in their own way is Slip [7].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Condition = tuple[str, int]

_BANDS = ((1.5, 8.0), (8.0, 20.0), (20.0, 50.0))  # [Hz]
_LEAST = 5  # samples in a window
_NO_CURRENT = 0.3  # [A] added before the logarithm
_NO_SHAKING = 1e-4  # [rad/s] likewise
_SPEED_STEPS = 1.5  # conditions an octave of rim speed

# Usual spread from second to second on one ground: what is assumed before a log tells.
_SPREAD_CURRENT, _SPREAD_FLUCTUATION, _SPREAD_TURNING = 0.15, 0.40, 0.15
_SPREAD_BANDS = (0.40, 0.35, 0.35)


@dataclass(frozen=True, slots=True)
class Window:
    """A second of steady driving.

    Attributes:
        condition: how it was driven.
        channels: (channels,) what the ground did to it.
    """

    condition: Condition
    channels: Floats


def usual_spread(rates: int) -> Floats:
    """(channels,) standard deviation of each channel with so many turn rates."""
    body = [_SPREAD_CURRENT, _SPREAD_FLUCTUATION, _SPREAD_TURNING]
    return np.array(body + list(_SPREAD_BANDS) * rates)


def summarise(samples: Floats, least_rim_speed: float, turn_begin: float) -> Window | None:
    """A window out of its samples, None unless it was driven steadily.

    Args:
        samples: (n, 5 + rates) v_left, v_right [m/s], currents left and right [A], yaw rate and
            further rates of turn [rad/s], evenly in time over one second.
        least_rim_speed: slower wheels do not count as driving [m/s].
        turn_begin: difference of rim speeds that is a turn [m/s].
    """
    if len(samples) < _LEAST:
        return None
    left, right = samples[:, 0], samples[:, 1]
    means = (float(np.mean(left)), float(np.mean(right)))
    rim = max(abs(mean) for mean in means)
    wander = float(np.std(left) + np.std(right))
    if rim < least_rim_speed or wander > 0.1 * rim + 0.01:
        return None
    difference = means[1] - means[0]
    turning = abs(difference) >= turn_begin
    kind = "straight" if not turning else "spot" if means[0] * means[1] < 0.0 else "turn"
    current = np.abs(samples[:, 2]) + np.abs(samples[:, 3])
    achieved = float(np.mean(samples[:, 4])) / difference if turning else 0.0
    channels = [
        math.log(_NO_CURRENT + float(np.mean(current))),
        math.log(_NO_CURRENT + float(np.std(current))),
        min(max(achieved, -0.5), 3.0),
        *_shaking(samples[:, 4:], rim),
    ]
    return Window((kind, round(_SPEED_STEPS * math.log2(rim))), np.array(channels))


def _shaking(rates: Floats, rim: float) -> Floats:
    """Log of the amplitude in each band of each rate over the rim speed; NaN beyond Nyquist."""
    count = len(rates)
    shaped = (rates - np.mean(rates, axis=0)) * np.hanning(count)[:, None]
    power = np.abs(np.fft.rfft(shaped, axis=0)) ** 2 / count
    frequency = np.arange(len(power), dtype=np.float64)  # the window lasts one second
    amplitudes = np.full((rates.shape[1], len(_BANDS)), math.nan)
    for index, (low, high) in enumerate(_BANDS):
        band = (frequency >= low) & (frequency <= high)
        if 2.0 * high <= count + 1.0 and band.any():
            amplitudes[:, index] = np.sqrt(np.mean(power[band], axis=0))
    return np.asarray(np.log((amplitudes + _NO_SHAKING) / rim).ravel())
