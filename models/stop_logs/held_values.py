"""Samples of a slow sensor that a fast log repeats: only the first of equal ones is a measurement.

Where a speed changes by more than its resolution, a fast sensor had changed in the sample before,
too; a slow one had been held for its period. Quantised speeds repeat values while they change by
one step of their resolution, and are not slow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats

_MOVING = 0.15  # [m/s] slower than that, equal values are standstill
_MIN_CHANGE_COUNT = 8  # from which a period is known
_STEP = 1.5  # changes of more than this many steps of the resolution are large
_LATE = 0.25  # share of a period by which a new value may be late
_HELD = 1.5  # rows that a fast sensor keeps a value for at most, on average


def held_period(columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]) -> float:
    """Time between new values of `v` in a drive log [s]; 0 if every row has one."""
    changes = [_changes(columns["t"][run], columns["v"][run]) for run in runs]
    size, rows, seconds = np.concatenate(changes, axis=1) if changes else np.empty((3, 0))
    if len(size) < _MIN_CHANGE_COUNT:
        return 0.0
    large = size > _STEP * float(np.min(size))
    if np.count_nonzero(large) < _MIN_CHANGE_COUNT or float(np.median(rows[large])) < _HELD:
        return 0.0
    return float(np.median(seconds[large]))


def _changes(time: Floats, speed: Floats) -> Floats:
    """(3, k) changes from moving: size [m/s], rows and time since the change before [s]."""
    change = np.diff(speed)
    at = np.flatnonzero(change != 0.0) + 1
    moving = np.abs(speed[at - 1]) > _MOVING
    size, rows = np.abs(change[at - 1]), np.diff(at, prepend=0)
    return np.array((size, rows, np.diff(time[at], prepend=time[0])))[:, moving]


def fresh_samples(columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]) -> Bools:
    """(n,) samples with a new value of `v`; at rest, one in a period of the sensor."""
    fresh = np.ones(len(columns["t"]), np.bool_)
    period = held_period(columns, runs)
    for run in runs if period > 0.0 else ():
        t, new = columns["t"][run], np.diff(columns["v"][run], prepend=np.nan) != 0.0
        begin = np.flatnonzero(new)[np.cumsum(new) - 1]
        # A value that lasts clearly longer was measured again, and is the same.
        periods = np.floor(np.maximum((t - t[begin]) / period - _LATE, 0.0))
        fresh[run] = new | (np.diff(periods, prepend=0.0) > 0.0)
    return fresh
