"""Samples of a slow sensor that a fast log repeats: only the first of equal ones is a measurement.

Where a speed changes by more than its resolution, a fast sensor had changed in the sample before,
too; a slow one had been held for its period. Quantised speeds repeat values while they change by
one step of their resolution, and are not slow.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats

_MOVING = 0.15  # [m/s] slower than that, equal values are standstill
_MIN_CHANGE_COUNT = 8
"""Changes from which a period is known [1]."""
_STEP = 1.5  # changes of more than so many steps of the resolution are large
_HELD = 1.5  # rows that a fast sensor keeps a value for at most, on average


def held_period(time: Floats, speed: Floats) -> float:
    """Time between new values of a speed in one run, (n,) each [s]; 0 if every row has one."""
    change = np.diff(speed)
    at = np.flatnonzero(change != 0.0) + 1
    size = np.abs(change[at - 1])
    moving = np.minimum(np.abs(speed[at - 1]), np.abs(speed[at])) > _MOVING
    if np.count_nonzero(moving) < _MIN_CHANGE_COUNT:
        return 0.0
    large = moving & (size > _STEP * float(np.min(size[moving])))
    rows, seconds = np.diff(at, prepend=0)[large], np.diff(time[at], prepend=time[0])[large]
    if len(rows) < _MIN_CHANGE_COUNT or float(np.median(rows)) < _HELD:
        return 0.0
    return float(np.median(seconds))


def fresh_samples(time: Floats, speed: Floats) -> Bools:
    """(n,) samples of one run with a new value; at rest, one in a period of the sensor."""
    fresh = np.ones(len(speed), np.bool_)
    period = held_period(time, speed)
    if period > 0.0:
        fresh[1:] = np.diff(speed) != 0.0
        begin = np.flatnonzero(fresh)[np.cumsum(fresh) - 1]
        periods = np.floor((time - time[begin]) / period + 0.1)
        fresh |= np.diff(periods, prepend=0.0) > 0.0
    return fresh
