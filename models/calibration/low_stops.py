"""The lower end of the last stops, which stops in between do not wash away.

Two weak stops in a row are a change of brakes or ground. Weak stops that alternate with others are
never two in a row, and each alone may be an error: an estimate of the mean follows the others. What
is published has to hold for the weak ones. Of the last stops all but one may therefore be no weaker
than what is planned with, beyond their scatter; else it falls to the second weakest at once, and
rises again when these stops are older than the window.

Source: none; an order statistic of a moving window.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from slopewise.models.arrays import Floats

WINDOW = 24
"""Stops that are remembered: so many true stops after the last weak one a rise begins."""

_GATE = 4.0  # standard deviations below which a stop is weak
_LEAST = 0.02  # [1] of a force


class LowStops:
    """The last stops of one surface."""

    def __init__(self) -> None:
        self._last: deque[tuple[Floats, float, float]] = deque(maxlen=WINDOW)

    def take(self, speed: float, grade: float, force_ratio: float, std: float) -> None:
        """One more stop: v_i [m/s], mean θ [rad], F_b/W and its measurement noise."""
        self._last.append((np.array([speed * grade, grade, speed, 1.0]), force_ratio, std))

    def share(self, coefficients: Floats, scatter: float) -> float:
        """Share of the force by these coefficients (4,) that all but one of the last stops had.

        1 where none is weaker than scatter makes it.

        Args:
            coefficients: estimate. scatter: of F_b/W from stop to stop.
        """
        shares = []
        for x, force, std in self._last:
            expected = max(float(x @ coefficients), _LEAST)
            if force < expected - _GATE * float(np.hypot(std, scatter)):
                shares.append(max(force, _LEAST) / expected)
        return 1.0 if len(shares) < 2 else sorted(shares)[1]
