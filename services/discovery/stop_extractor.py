"""Extracts stops from streams of drive samples, from before the stop command to rest.

Memory is bounded by one stop per source.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.wire.arrival import MAX_ROBOT_SENDERS, SenderTable
from slopewise.services.wire.observations import MAX_SAMPLES

_STOP_COMMAND = 0.01  # largest command that is a stop command [m/s]
_STANDSTILL_SPEED = 0.02  # speed of a standing vehicle [m/s]

_BEFORE, _AFTER = 1.5, 1.0
"""Time before the command and after rest that belongs to a stop [s], as calibration needs."""

_MAX_GAP = 0.5  # longest gap between samples of one stop [s]
_MAX_DURATION = 30.0  # longest stop [s]
_MIN_SPEED = 0.3  # lowest speed of a stop [m/s]; sensor noise hides slower ones


class StopExtractor:
    """Returns stops as their last samples arrive; one thread."""

    def __init__(self) -> None:
        self._streams = SenderTable[str, dict[str, Floats]](dict, MAX_ROBOT_SENDERS)

    def add_samples(self, source: str, columns: Mapping[str, Floats]) -> list[dict[str, Floats]]:
        """Columns of the stops that are complete with these samples, (n,) by name, SI."""
        held = self._streams.of(source)
        if held.keys() != columns.keys() or columns["t"][0] <= held["t"][-1]:
            stream = {name: np.array(values) for name, values in columns.items()}
        else:
            stream = {name: np.concatenate((held[name], columns[name])) for name in held}
        stops, keep = _complete(stream)
        self._streams[source] = {name: values[keep:] for name, values in stream.items()}
        return [stop for stop in stops if len(stop["t"]) <= MAX_SAMPLES]


def _complete(columns: Mapping[str, Floats]) -> tuple[list[dict[str, Floats]], int]:
    """Complete stops, and the first sample that later ones need."""
    t, v, commanded = columns["t"], columns["v"], columns["v_cmd"] <= _STOP_COMMAND
    stops: list[dict[str, Floats]] = []
    done = 0
    for i in (np.flatnonzero(commanded[1:] & ~commanded[:-1]) + 1).tolist():
        again = np.flatnonzero(~commanded[i:])
        released = i + int(again[0]) if len(again) else len(t)
        gaps = np.flatnonzero(np.diff(t[i:released]) > _MAX_GAP)
        last = i + int(gaps[0]) + 1 if len(gaps) else released
        still = np.flatnonzero(v[i:last] <= _STANDSTILL_SPEED)
        begin = max(int(np.searchsorted(t, t[i] - _BEFORE)), done)
        if v[i] < _MIN_SPEED:
            continue
        open_ended = last == len(t)
        if not len(still):
            if open_ended and t[-1] - t[i] <= _MAX_DURATION:
                return stops, begin
            continue
        rest = i + int(still[0])
        if open_ended and t[-1] - t[rest] < _AFTER:
            return stops, begin
        earlier = np.flatnonzero(np.diff(t[begin : i + 1]) > _MAX_GAP)
        begin += int(earlier[-1]) + 1 if len(earlier) else 0
        done = min(int(np.searchsorted(t, t[rest] + _AFTER, side="right")), last)
        stops.append({name: np.array(values[begin:done]) for name, values in columns.items()})
    # The last sample always stays: the next one is compared with it.
    return stops, min(max(done, int(np.searchsorted(t, t[-1] - _BEFORE))), len(t) - 1)
