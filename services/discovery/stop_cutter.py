"""Samples of stops out of streams of drive samples: from before the command until it stands.

What the discrepancy workflow looks at, and nothing more: memory is bounded by one stop a source.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats

_TOLD = 0.01  # [m/s] a command of at most this is the stop command
_STANDING = 0.02  # [m/s]
_BEFORE, _AFTER = 1.5, 1.0  # [s] around a stop that belong to it
_GAP = 0.5  # [s] a stop with a longer one in it is none
_LONGEST = 30.0  # [s]
_LEAST_SPEED = 0.3  # [m/s] slower vehicles have nothing to stop
_MOST_SAMPLES = 20_000
_MOST_SOURCES = 8


@dataclass(frozen=True, slots=True)
class CutStop:
    """One stop. ``columns``: (n,) each, SI; ``surface``: as it was called at the stop command."""

    source: str
    surface: str
    columns: dict[str, Floats]


class StopCutter:
    """Feed messages in, get stops out; one thread."""

    def __init__(self) -> None:
        self._streams: OrderedDict[str, dict[str, Floats]] = OrderedDict()

    def take(self, source: str, columns: Mapping[str, Floats], surface: str) -> list[CutStop]:
        """The stops that are complete with these samples.

        Args:
            source: of the samples. columns: (n,) by name, ``t`` increasing; ``v``, ``v_cmd``.
            surface: that they were driven on, empty where nobody knows.
        """
        held = self._streams.pop(source, None)
        if held is None or held.keys() != columns.keys() or columns["t"][0] <= held["t"][-1]:
            stream = {name: np.array(values) for name, values in columns.items()}
        else:
            stream = {name: np.concatenate((held[name], columns[name])) for name in held}
        cuts, keep = _complete(stream)
        self._streams[source] = {name: values[keep:] for name, values in stream.items()}
        while len(self._streams) > _MOST_SOURCES:
            self._streams.popitem(last=False)
        return [CutStop(source, surface, cut) for cut in cuts if len(cut["t"]) <= _MOST_SAMPLES]


def _complete(columns: Mapping[str, Floats]) -> tuple[list[dict[str, Floats]], int]:
    """Stops that nothing more can belong to, and the first sample that is needed further on."""
    t, v, told = columns["t"], columns["v"], columns["v_cmd"] <= _TOLD
    found: list[dict[str, Floats]] = []
    done = 0
    for i in (np.flatnonzero(told[1:] & ~told[:-1]) + 1).tolist():
        again = np.flatnonzero(~told[i:])
        released = i + int(again[0]) if len(again) else len(t)
        gaps = np.flatnonzero(np.diff(t[i:released]) > _GAP)
        last = i + int(gaps[0]) + 1 if len(gaps) else released
        still = np.flatnonzero(v[i:last] <= _STANDING)
        begin = max(int(np.searchsorted(t, t[i] - _BEFORE)), done)
        if v[i] < _LEAST_SPEED:
            continue
        open_ended = last == len(t)
        if not len(still):
            if open_ended and t[-1] - t[i] <= _LONGEST:
                return found, begin
            continue
        rest = i + int(still[0])
        if open_ended and t[-1] - t[rest] < _AFTER:
            return found, begin
        earlier = np.flatnonzero(np.diff(t[begin : i + 1]) > _GAP)
        begin += int(earlier[-1]) + 1 if len(earlier) else 0
        done = min(int(np.searchsorted(t, t[rest] + _AFTER, side="right")), last)
        found.append({name: np.array(values[begin:done]) for name, values in columns.items()})
    # The last sample stays in any case: what comes next is compared with it.
    return found, min(max(done, int(np.searchsorted(t, t[-1] - _BEFORE))), len(t) - 1)
