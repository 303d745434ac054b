"""Application of the brakes during a stop, by the channel of a log."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats

_HELD_ON = 0.85  # share of the samples of a stop at one application; the rest is its building up


def application(brake: Floats | None, uneven: float) -> tuple[float, bool]:
    """Application of the brakes during a stop, and whether it is held; full without the channel.

    Args:
        brake: (n,) 0 … 1, NaN where it is missing, 0 where it is yet to come.
        uneven: how far from the median [1].
    """
    if brake is None:
        return 1.0, True
    brake = brake[np.isfinite(brake) & (brake > 0.0)]
    if not len(brake):
        return 1.0, True
    level = float(np.median(brake))
    return level, bool(np.mean(np.abs(brake - level) <= uneven) >= _HELD_ON)
