"""Bias of a yaw rate gyroscope, learned while the vehicle stands.

The mean of the samples at rest, with older ones forgotten so that it follows slow drift.
Validity: rim speeds show rest, and the yaw rate a vehicle that is towed or slides.
Omits: temperature. Source: Slip 2.1 takes the gyroscope as free of bias; standard practice.
"""

from __future__ import annotations


class GyroBias:
    """Running mean [rad/s] of the yaw rate at rest."""

    def __init__(self, memory: float = 60.0) -> None:
        """Begin with bias 0; ``memory``: time constant of forgetting [s of rest]."""
        self.bias = 0.0
        self._memory = memory
        self._samples = 0

    def update(self, yaw_rate: float, elapsed: float) -> None:
        """One sample at rest [rad/s], ``elapsed`` after the one before [s]."""
        self._samples += 1
        gain = max(1.0 / self._samples, min(1.0, elapsed / self._memory))
        self.bias += gain * (yaw_rate - self.bias)
