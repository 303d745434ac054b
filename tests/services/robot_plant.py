"""A vehicle that brakes, by Newton alone: none of the project's code is in it.

The speed is held for the dead time, then brakes and slope slow it evenly; wheels and their
encoders are noisy, and no stop brakes exactly like the one before.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

G = 9.80665


@dataclass
class Surface:
    """F_b/W = force + slope * speed at brake onset; every stop scatters by a share of it."""

    force: float
    slope: float = 0.0
    scatter: float = 0.01


ASPHALT = Surface(0.55, -0.005)
SAND = Surface(0.40, 0.0, 0.015)
ICE = Surface(0.15, -0.002, 0.015)


@dataclass
class Vehicle:
    """Drives at a speed and stops on command; its clock runs on from stop to stop."""

    seed: int = 0
    dead_time: float = 0.3
    rate: float = 50.0
    encoder_std: float = 0.01
    time: float = 0.0
    random: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)

    def stop(self, surface: Surface, speed: float, grade: float = 0.0) -> tuple[float, Any]:
        """Distance from the stop command to rest [m], and the samples around it."""
        scatter = 1.0 + surface.scatter * self.random.uniform(-2.0, 2.0)
        force = (surface.force + surface.slope * speed) * scatter
        slowing = G * (force + np.sin(grade))
        assert slowing > 0.0, "this vehicle cannot hold on that slope"
        braking = speed / slowing
        distance = speed * self.dead_time + 0.5 * speed * braking
        t = np.arange(-1.0, self.dead_time + braking + 0.5, 1.0 / self.rate)
        v = np.clip(speed - slowing * np.maximum(t - self.dead_time, 0.0), 0.0, speed)
        noisy = v + self.encoder_std * self.random.normal(size=t.size) * (v > 0.0)
        samples = {
            "t": self.time + t + 1.0,
            "v": np.maximum(noisy, 0.0),
            "v_cmd": np.where(t < 0.0, speed, 0.0),
            "pitch": np.full(t.size, -grade),
        }
        self.time = float(samples["t"][-1]) + 1.0
        return distance, samples
