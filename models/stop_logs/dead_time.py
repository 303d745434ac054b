"""Common to the onsets of all stops: the dead time of the brakes, and how well speeds are held.

It is a property of the hardware, so all stops share it up to a scatter from stop to stop. Knowing
it sharpens each single stop: onset and force of a knee are correlated, and an onset pulled towards
the common dead time takes its force along.

A stop command is logged with the first sample that shows it, and the dead time counts from that
sample. Source: Braking Sec. 2, where it is read off a plot as 0.3 s on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.onset import CREEP, HELD, Knee

_MIN_STOP_COUNT = 30  # stops without which their spread says little about how speeds are held
_NO_IDEA = 1.0  # [s] prior standard deviation around nothing in particular


@dataclass(frozen=True, slots=True)
class DeadTime:
    """t_delay [s], its standard deviation, and its scatter from stop to stop."""

    value: float
    std: float
    between_stops: float


def dead_time(knees: Sequence[Knee], noise: Floats) -> DeadTime:
    """Common dead time of some stops, at least one; noise: (n,) of the speed of each [m/s]."""
    onset = np.array([knee.onset_time for knee in knees])
    std = noise * np.sqrt([knee.covariance[1, 1] for knee in knees])
    fit = random_effects.fit_mean(onset, std, float(np.median(onset)), _NO_IDEA)
    value = max(float(fit.coefficients[0]), 0.0)
    return DeadTime(value, float(np.sqrt(fit.covariance[0, 0])), fit.scatter)


@dataclass(frozen=True, slots=True)
class Sharpened:
    """Stops once their common dead time is known, (n,) each."""

    onset_speed: Floats  # [m/s]
    force_ratio: Floats  # F_b/W
    force_std: Floats  # its measurement noise
    by_dead_time: Floats  # change of the force with the dead time [1/s]: an error of all alike


def sharpen(knees: Sequence[Knee], noise: Floats, common: DeadTime) -> Sharpened:
    """Condition every knee on the common dead time, as normal distributions are conditioned."""
    covariance = np.stack([knee.covariance for knee in knees]) * (noise**2)[:, None, None]
    onset = np.array([knee.onset_time for knee in knees])
    speed = np.array([knee.onset_speed for knee in knees])
    force = np.array([knee.force_ratio for knee in knees])
    spread = covariance[:, 1, 1] + common.between_stops**2
    shift = common.value - onset
    # An onset far from all others is not pulled towards them.
    is_typical = np.abs(shift) <= 5.0 * np.sqrt(spread)
    by_force = np.where(is_typical, covariance[:, 1, 2] / spread, 0.0)
    by_speed = np.where(is_typical, covariance[:, 0, 1] / spread, 0.0)
    variance = covariance[:, 2, 2] - by_force * covariance[:, 1, 2]
    return Sharpened(
        speed + by_speed * shift,
        force + by_force * shift,
        np.sqrt(np.maximum(variance, 1e-12)),
        by_force,
    )


def held_weights(knees: Sequence[Knee | None], noise: Floats) -> Floats:
    """(n,) weight of the evidence that the speed was held, for :func:`.onset.fit_knee` [s²].

    ``knees``: first fits, with the weak weight; ``noise``: of the speed of those with a fit [m/s].
    """
    weights = np.full(len(knees), HELD)
    measured = [knee for knee in knees if knee is not None]
    if len(measured) < _MIN_STOP_COUNT:
        return weights
    creep = np.array([knee.creep for knee in measured])
    std = noise * np.sqrt([knee.creep_variance for knee in measured])
    fit = random_effects.fit_mean(creep, np.maximum(std, 1e-9), 0.0, CREEP)
    # A spread that is not seen may still be as large as chance could hide.
    hidden = float(np.mean(std**2)) * np.sqrt(2.0 / len(creep))
    spread = np.sqrt(fit.scatter**2 + float(fit.coefficients[0]) ** 2 + hidden)
    # A stop that crept unlike all others keeps its creep.
    retained = np.where(fit.kept, np.minimum((noise / spread) ** 2, 1e6), HELD)
    weights[[knee is not None for knee in knees]] = np.maximum(retained, HELD)
    return weights
