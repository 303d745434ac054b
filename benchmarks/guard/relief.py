"""Rolling ground as a sum of waves, with its slopes in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Relief:
    """Waves a sin(k_x x + k_y y + φ), (W,) each."""

    height: np.ndarray  # a [m]
    east: np.ndarray  # k_x, k_y [rad/m]
    north: np.ndarray
    phase: np.ndarray  # φ [rad]

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights at points of any shape [m]."""
        z = np.zeros_like(x)
        for a, p, q, phase in zip(self.height, self.east, self.north, self.phase, strict=True):
            z += a * np.sin(p * x + q * y + phase)
        return z

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Rise to the east and to the north at a point [1]."""
        slope = self.height * np.cos(self.east * x + self.north * y + self.phase)
        return float(slope @ self.east), float(slope @ self.north)


def gentle() -> Relief:
    """Waves of 5 cm, with slopes below 2°."""
    return Relief(np.full(2, 0.025), np.full(2, 0.4), np.array([0.3, -0.3]), np.zeros(2))


def hills(rng: np.random.Generator) -> Relief:
    """Waves 8 to 40 m long, of which the steepest ground is 3° to 15°."""
    length, bearing = rng.uniform(8.0, 40.0, 5), rng.uniform(-np.pi, np.pi, 5)
    k, share = 2.0 * np.pi / length, rng.uniform(0.2, 1.0, 5)
    steepest = math.tan(math.radians(float(rng.uniform(3.0, 15.0))))
    # Five waves with random phases are steepest together at about 0.6 of the sum of their slopes.
    height = steepest / 0.6 * share / share.sum() / k
    return Relief(height, k * np.cos(bearing), k * np.sin(bearing), rng.uniform(0.0, 7.0, 5))
