"""Speed tracking error of a vehicle, estimated from a drive log.

A plan bounds speeds; the vehicle tracks them with an error, and a stop from a higher speed is
longer. The error is that of a settled speed controller: once the command has been constant for
`SETTLING`, speeds are averaged over half seconds, which suppresses sensor noise and keeps the
oscillation of the controller.

The estimate tolerates one outlier in six samples. It is the larger of the scatter within stretches
of constant command and the 84 % quantile of the error: constant overspeed widens it, constant
underspeed does not.

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
_MIN_SPEED = 0.3  # [m/s]
_SAME = (0.01, 0.02)  # [m/s], and share of the command, by which one command may vary
_BLOCK = 0.5  # [s]
_MIN_STRETCHES = 5
"""Stretches at constant command that a speed error needs [1]; fewer are one manoeuvre."""
_MIN_SECONDS = 20.0
"""Driving at constant command that a speed error needs, all stretches together [s]."""
_ONE_STD = 0.8413
"""Quantile of a normal law one standard deviation above its mean [1]."""
_MAX_SHARE = 0.3  # share of the command; above it, the vehicle did not follow that command


@dataclass(frozen=True, slots=True)
class SpeedError:
    """Speed tracking error over the settled stretches of a log.

    Attributes:
        value: standard deviation of driven minus commanded speed [m/s].
        bias: median error [m/s].
        stretches, seconds: number and duration [s] of the stretches used.
    """

    value: float
    bias: float
    stretches: int
    seconds: float


def speed_error(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], usable_samples: Bools
) -> SpeedError | None:
    """Speed tracking error; None where the log has too little settled driving.

    Args:
        columns: channels by name, (n,): ``t`` [s], ``v`` and ``v_cmd`` [m/s].
        runs: samples of each run. good: (n,) samples that may be used.
    """
    errors = [value for run in runs for value in _of_run(columns, run, usable_samples)]
    seconds = _BLOCK * sum(len(error) for error, _ in errors)
    if len(errors) < _MIN_STRETCHES or seconds < _MIN_SECONDS:
        return None
    every = np.concatenate([error for error, _ in errors])
    within = np.concatenate([error - np.median(error) for error, _ in errors])
    scatter = PER_MAD * float(np.median(np.abs(within)))
    value = max(scatter, float(np.quantile(every, _ONE_STD)))
    if value > _MAX_SHARE * float(np.median([command for _, command in errors])):
        return None
    return SpeedError(value, float(np.median(every)), len(errors), seconds)


def _of_run(
    columns: Mapping[str, NDArray[Any]], run: slice, usable_samples: Bools
) -> Iterator[tuple[Floats, float]]:
    """Mean error of each half second of each stretch [m/s], and its command [m/s]."""
    t, v, v_cmd = (np.asarray(columns[name][run], np.float64) for name in ("t", "v", "v_cmd"))
    usable = usable_samples[run] & (v_cmd > _MIN_SPEED) & np.isfinite(v)
    jumps = np.abs(np.diff(v_cmd)) > np.maximum(_SAME[0], _SAME[1] * np.abs(v_cmd[:-1]))
    edges = np.flatnonzero(jumps | (np.diff(usable) != 0)) + 1
    for begin, end in zip([0, *edges], [*edges, len(t)], strict=True):
        if not usable[begin]:
            continue
        command = float(np.median(v_cmd[begin:end]))
        settled = slice(begin + int(np.searchsorted(t[begin:end] - t[begin], SETTLING)), end)
        blocks = ((t[settled] - t[begin] - SETTLING) / _BLOCK).astype(np.int64)
        # A drifting command is not constant; the last block is incomplete.
        if len(blocks) == 0 or np.ptp(v_cmd[begin:end]) > max(_SAME[0], _SAME[1] * command):
            continue
        count = np.bincount(blocks)[:-1]
        error = np.bincount(blocks, weights=v[settled] - v_cmd[settled])[:-1]
        if (count > 0).any():
            yield error[count > 0] / count[count > 0], command
