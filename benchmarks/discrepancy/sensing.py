"""Drive logs of stops: noise, steps of the encoder, and a body that rocks back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .effect_plant import DrivenStops
from .plant_physics import Floats, Stops

RATE = 50.0  # Sampling rate [Hz]
BEFORE, AFTER = 2.0, 1.0  # Logged time before each command and after each standstill [s]
QUANTUM = 0.01  # Step of the logged speed [m/s]
CORRELATED, MEMORY = 0.2, 0.08
"""Correlated share of the speed noise's variance [1], and its time constant [s]."""

_PITCH, _ROLL, _YAW = 0.004, 0.004, 0.01  # [rad]
_YAW_RATE = 0.01  # [rad/s]
_PLACE = 0.04  # [m]
_ROCK, _ROCK_SPEED, _ROCK_DAMPING = 0.010, 22.0, 6.0  # [s], [rad/s], [1/s]

Columns = dict[str, NDArray[Any]]


def sample_times(longest: float) -> Floats:
    """Sampling grid around a stop command, 0 included [s]."""
    return np.arange(-round(BEFORE * RATE), round(longest * RATE) + 1) / RATE


def log(motion: DrivenStops, stops: Stops, noise: float, rng: np.random.Generator) -> Columns:
    """Columns of a drive log, one run after the other, with this noise of the speed [m/s].

    Stops that never come to rest end where the sampling ends.
    """
    time = motion.time
    keep = time[None, :] <= np.minimum(motion.rest + AFTER, time[-1])[:, None]
    shape = motion.speed.shape
    after = np.maximum(time[None, :] - motion.rest[:, None], 0.0)
    rock = motion.deceleration[:, None] * _ROCK * np.exp(-_ROCK_DAMPING * after)
    speed = motion.speed - rock * np.sin(_ROCK_SPEED * after)
    speed = speed + noise * _correlated(shape, rng)
    count = np.arange(len(stops.speed))[:, None]
    command = np.where(time[None, :] < 0.0, stops.speed[:, None], 0.0)

    def noisy(values: Floats, std: float) -> Floats:
        return values + std * rng.standard_normal(shape)

    table = {
        "run": np.broadcast_to(count, shape),
        "t": stops.clock[:, None] + time[None, :],
        "v": np.round(speed / QUANTUM) * QUANTUM,
        "v_cmd": command,
        "pitch": noisy(-motion.grade, _PITCH),
        "roll": noisy(motion.roll, _ROLL),
        "yaw": np.mod(noisy(motion.yaw, _YAW) + np.pi, 2.0 * np.pi) - np.pi,
        "yaw_rate": noisy(motion.yaw_rate, _YAW_RATE),
        "x": noisy(motion.x, _PLACE),
        "y": noisy(motion.y, _PLACE),
        "ambient": np.broadcast_to(stops.ambient[:, None], shape),
    }
    columns: Columns = {name: values[keep] for name, values in table.items()}
    columns["run"] = columns["run"].astype(str)
    return columns


def _correlated(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """Unit noise, most of it white, the rest of first order."""
    from scipy.signal import lfilter

    a = float(np.exp(-1.0 / (RATE * MEMORY)))
    innovation = rng.standard_normal(shape) * np.sqrt(1.0 - a * a)
    innovation[:, 0] /= np.sqrt(1.0 - a * a)
    slow = lfilter([1.0], [1.0, -a], innovation, axis=1)
    white = rng.standard_normal(shape)
    mixed: Floats = np.sqrt(1.0 - CORRELATED) * white + np.sqrt(CORRELATED) * slow
    return mixed
