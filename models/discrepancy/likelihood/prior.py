"""Priors of all logs: sizes of nuisances and effects, and odds of explanations."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import Matrix

# Nuisances, one standard deviation each: what vehicles and sensors are usually like.
DEAD_TIME_STEP = 0.02  # [s] that a step of the linear fit may move the dead time
AT_ONSET = 0.03  # slip of the tyres, and resistance before the brakes, per share of the weight [1]
BODY = 0.005  # that a point of the body moves, and that it pitches, per deceleration [m, rad s²/m]
BODY_SHIFT = 0.00015  # the same within 30 ms of delay [m s per m/s²]
SESSION = 0.02  # force between days or sessions, share of the force [1]
SPIKE = 0.005  # force of every smooth effect, share of the force [1]

LEVEL = 10.0  # speed of each stop: unknown [m/s]
RAMP = 0.3  # acceleration before the onset [m/s²]
LEVELS = 2  # own effects of a stop that are these two; the next is its dead time
NOISE = np.array([0.03, 0.02, 0.012, 0.02, 0.006, 0.01])
"""Usual noise [m/s], scatter of the force [1], of the dead time [s], slow wave of the force [1],
and residual at the onset, as time [s] and as a share of the force [1]."""
WAVE, ONSET_TIME, ONSET_FORCE = 3, 4, 5  # places of the last three
NOISE_SPREAD = np.array([0.7, 1.0, 0.7, 0.7, 1.0, 1.2])  # of their logarithms [1]

BUILD_UP = 0.018  # usual time constant of brakes [s]
LOG_SPREAD = 0.45  # of its logarithm, and of those of the body's frequency and damping [1]
LAG = (0.1, 0.8)
"""Time constants of a lag, evenly in the logarithm [s]: shorter ones are build-ups.

Next to an equally long dead time, a lag τ shortens stops by a τ²/2: by 2 cm at 0.1 s and 4 m/s².
"""
SLOW = 0.1, 0.004  # share of brakes with any build-up from this [s] to a lag [1]

SLAB = 0.12  # rms force of an effect, share of the force [1]
NAME = 0.08  # odds of a name against none [1]
AXIS = 0.02  # odds of a cause without a name along an axis [1]
TEMPER = 0.85  # share of the evidence that counts: model errors are alike in all stops [1]
RULED_OUT = 0.05
"""Relative weight or p-value below which a cause is excluded; share outside intervals [1]."""

CHANGED = 0.2  # share of logs whose vehicle has changed since its file was made [1]


def calibrated(force: float, speed: float, covariance: Matrix | None) -> Floats:
    """(4,) of the coefficients as calibrated: what they differ by between days, and their error.

    Brakes differ by `SESSION` between days, and slopes to match.

    Args:
        force: typical F_b/W [1]. speed: mean at the onset, about which coefficients are [m/s].
        covariance: that of the file's coefficients, None where it states none.
    """
    between_days = np.array([SESSION * force, 0.03, 0.004, 0.008])
    if covariance is None:
        return between_days
    about = of_coefficients(speed)
    error = np.sqrt(np.diag(about @ np.array(covariance) @ about.T))
    std: Floats = np.hypot(between_days, error)
    return std


def of_coefficients(speed: float) -> Floats:
    """(4, 4) level force and slope at a mean speed, and with it, by m_m, b_m, m_b and b_b."""
    return np.array([[0, 0, speed, 1], [speed, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0]], np.float64)


def changed(force: float) -> Floats:
    """(4,) of the coefficients, which may have changed since the file: 20 % of the force."""
    return np.array([0.2 * force, 0.25, 0.04, 0.08])


def own_variance(noise: Floats, count: int) -> Floats:
    """(count,) variances of a stop's own effects: level, ramp, dead time, force and slow waves."""
    _, force, late, wave = noise[:4]
    slow = wave**2 / np.arange(1, count - 3) ** 2
    return np.array([LEVEL**2, RAMP**2, late**2, force**2, *slow])


def of_build_up(log_tau: Floats, *, lag: bool) -> Floats:
    """Density over ln τ of brakes with a lag, or without one."""
    low, high = np.log(LAG if lag else (SLOW[1], LAG[0]))
    even = np.where((log_tau >= low) & (log_tau <= high), 1.0 / (high - low), 0.0)
    if lag:
        return np.asarray(even, np.float64)
    z = (log_tau - np.log(BUILD_UP)) / LOG_SPREAD
    typical = np.exp(-0.5 * z**2) / (LOG_SPREAD * np.sqrt(2.0 * np.pi))
    density: Floats = (1.0 - SLOW[0]) * typical + SLOW[0] * even
    return density
