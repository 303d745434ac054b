"""Commands that sink towards a stop instead of falling to 0: braking begins before the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.find_stops import StopWindow

_BEFORE = 1.0  # [s] examined
_SUNK = 0.95  # share of its largest value there that the last command before 0 has at most
_MIN_SHARE = 0.5  # of the stops, from which it is reported


def sinking_commands(
    columns: Mapping[str, NDArray[Any]], windows: Sequence[StopWindow]
) -> tuple[str, ...]:
    """Warning where the command sank gradually in most usable stops, else empty."""
    last = np.array([_last_command(columns, w) for w in windows if w.usable])
    sunk = last[last <= _SUNK]
    if len(last) == 0 or len(sunk) <= _MIN_SHARE * len(last):
        return ()
    share = f"{100.0 * float(np.median(sunk)):.0f} %"
    warning = (
        f"in {len(sunk)} of {len(last)} stops the commanded speed sank before it was 0, to {share} "
        "of what it had been: the vehicle slowed before the stop command, and the dead time is "
        "too short for a command that falls in one step"
    )
    return (warning,)


def _last_command(columns: Mapping[str, NDArray[Any]], window: StopWindow) -> float:
    """The last command before 0 as a share of the largest of the second before it."""
    before = slice(window.begin, window.command)
    time = np.asarray(columns["t"][before], np.float64)
    command: Floats = np.asarray(columns["v_cmd"][before], np.float64)
    recent = command[time >= columns["t"][window.command] - _BEFORE]
    largest = float(np.max(recent, initial=0.0))
    return float(recent[-1]) / largest if largest > 0.0 else 1.0
