"""How well a vehicle drives the speed that it is told, out of a drive log.

A plan bounds speeds; the vehicle drives them with an error, and a stop from a faster speed is
longer. What counts is the error of a speed controller that has settled: while the command has been
the same for a while, speeds are averaged over half seconds, so that noise of the sensor is mostly
out and waves of the controller are in.

The error is robust, one sample in six may be anything. It is the scatter within stretches of one
command, or the speed above the command that five samples in six do not exceed, whichever is more: a
vehicle that is always too slow is held back by nothing here, one that is always too fast is.

Source: none; both numbers are the standard deviation where errors are normal and without bias.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.stop_logs.random_effects import PER_MAD

SETTLING = 2.0  # [s] of one command before speeds count
_LEAST_SPEED = 0.3  # [m/s]
_SAME = (0.01, 0.02)  # [m/s], and share of the command, by which one command may vary
_BLOCK = 0.5  # [s]
_FEWEST_STRETCHES = 5
"""Stretches at constant command that a speed error needs [1]; fewer are one manoeuvre."""
_FEWEST_SECONDS = 20.0
"""Driving at constant command that a speed error needs, all stretches together [s]."""
_ONE_STD = 0.8413
"""Quantile of a normal law one standard deviation above its mean [1]."""
_MOST = 0.3  # of the command: whatever is farther off is not that command


@dataclass(frozen=True, slots=True)
class SpeedError:
    """What settled stretches of a log tell.

    Attributes:
        value: standard deviation of driven minus commanded speed [m/s].
        bias: median of it [m/s].
        stretches, seconds: that it rests on.
    """

    value: float
    bias: float
    stretches: int
    seconds: float


def speed_error(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], good: Bools
) -> SpeedError | None:
    """The error of driven speeds; None where the log has too little of a settled controller.

    Args:
        columns: channels by name, (n,): ``t`` [s], ``v`` and ``v_cmd`` [m/s].
        runs: samples of each run. good: (n,) samples that may be used.
    """
    errors = [one for run in runs for one in _of_run(columns, run, good)]
    seconds = _BLOCK * sum(len(error) for error, _ in errors)
    if len(errors) < _FEWEST_STRETCHES or seconds < _FEWEST_SECONDS:
        return None
    every = np.concatenate([error for error, _ in errors])
    within = np.concatenate([error - np.median(error) for error, _ in errors])
    scatter = PER_MAD * float(np.median(np.abs(within)))
    value = max(scatter, float(np.quantile(every, _ONE_STD)))
    if value > _MOST * float(np.median([command for _, command in errors])):
        return None
    return SpeedError(value, float(np.median(every)), len(errors), seconds)


def _of_run(
    columns: Mapping[str, NDArray[Any]], run: slice, good: Bools
) -> Iterator[tuple[Floats, float]]:
    """Mean error of each half second of each stretch [m/s], and its command [m/s]."""
    t, v, v_cmd = (np.asarray(columns[name][run], np.float64) for name in ("t", "v", "v_cmd"))
    usable = good[run] & (v_cmd > _LEAST_SPEED) & np.isfinite(v)
    jumps = np.abs(np.diff(v_cmd)) > np.maximum(_SAME[0], _SAME[1] * np.abs(v_cmd[:-1]))
    edges = np.flatnonzero(jumps | (np.diff(usable) != 0)) + 1
    for begin, end in zip([0, *edges], [*edges, len(t)], strict=True):
        if not usable[begin]:
            continue
        command = float(np.median(v_cmd[begin:end]))
        settled = slice(begin + int(np.searchsorted(t[begin:end] - t[begin], SETTLING)), end)
        blocks = ((t[settled] - t[begin] - SETTLING) / _BLOCK).astype(np.int64)
        # A command that creeps is not one; the last block is hardly whole.
        if len(blocks) == 0 or np.ptp(v_cmd[begin:end]) > max(_SAME[0], _SAME[1] * command):
            continue
        count = np.bincount(blocks)[:-1]
        error = np.bincount(blocks, weights=v[settled] - v_cmd[settled])[:-1]
        if (count > 0).any():
            yield error[count > 0] / count[count > 0], command
