"""Bias of a yaw rate gyroscope, learned while the vehicle stands.

The mean of the samples at rest, with older ones forgotten so that it follows slow drift.
Validity: rim speeds tell rest; a vehicle that is towed or slides is told by its yaw rate.
Omits: temperature. Source: Slip 2.1 takes the gyroscope as free of bias; standard practice.
"""

from __future__ import annotations

import math


class GyroBias:
    """Running mean [rad/s] of the yaw rate at rest."""

    def __init__(self, memory: float = 60.0) -> None:
        """Begin with bias 0; ``memory``: time constant of forgetting [s of rest]."""
        self.bias = 0.0
        self.seconds = 0.0
        self._memory = memory
        self._variance = 0.0
        self._samples = 0

    def update(self, yaw_rate: float, elapsed: float) -> None:
        """One sample at rest [rad/s], so long after the one before [s]."""
        self._samples += 1
        self.seconds = min(self.seconds + elapsed, self._memory)
        gain = max(1.0 / self._samples, min(1.0, elapsed / self._memory))
        difference = yaw_rate - self.bias
        self.bias += gain * difference
        self._variance += gain * ((1.0 - gain) * difference * difference - self._variance)

    @property
    def bias_std(self) -> float:
        """Standard error of the bias [rad/s]; infinite before the first rest."""
        if self._samples < 2:
            return math.inf
        return math.sqrt(self._variance / self._samples)
