"""What the channels of a run say around a stop: noise at rest, application of the brakes."""

from __future__ import annotations

import numpy as np

from models.arrays import Bools, Floats

_AT_REST = 5.0  # [s] told to stand for longer, a vehicle does
_FEWEST = 20  # samples at rest that tell its noise
_NOISE = 0.98  # quantile of the speeds read at rest
_MOST_NOISE = 0.4  # of the slowest stop: a sensor that reads more at rest sees no standstill
_HELD_ON = 0.85  # share of the samples of a stop at one application; the rest is its building up


def settled_speed(
    time: Floats, speed: Floats, told: Bools, good: Bools, least: float, slowest: float
) -> float:
    """Speed that the sensor of a run reads at rest [m/s].

    Args:
        time, speed: (n,) [s], [m/s]. told: (n,) to stand. good: (n,) samples that may be used.
        least: at least that. slowest: speed of the slowest stops [m/s].
    """
    starts = np.flatnonzero(told & ~np.concatenate(([False], told[:-1])))
    if not len(starts):
        return least
    since = time[starts][np.searchsorted(starts, np.arange(len(time)), "right") - 1]
    rest = good & told & (time - since > _AT_REST)
    if int(rest.sum()) < _FEWEST:
        return least
    floor = float(np.quantile(np.abs(speed[rest]), _NOISE))
    return min(max(floor, least), max(_MOST_NOISE * slowest, least))


def application(brake: Floats | None, uneven: float) -> tuple[float, bool]:
    """Application of the brakes during a stop, and whether it is held; full where nothing is told.

    Args:
        brake: (n,) 0 … 1, NaN where it is not told, 0 where it is yet to come.
        uneven: how far from the median [1].
    """
    if brake is None:
        return 1.0, True
    brake = brake[np.isfinite(brake) & (brake > 0.0)]
    if not len(brake):
        return 1.0, True
    level = float(np.median(brake))
    return level, bool(np.mean(np.abs(brake - level) <= uneven) >= _HELD_ON)
