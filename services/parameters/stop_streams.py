"""Stops in the drive samples of several senders."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from slopewise.services.settings.learning_settings import Learning

_MAX_STREAMS = 8
"""Senders whose streams are followed [1]; a robot has one or two."""


class StopStreams:
    """One stream of samples per sender, the latest few; one thread."""

    def __init__(self, settings: Learning) -> None:
        self._mount, self._dive = settings.mount, settings.dive
        self._streams: dict[str, StopStream] = {}

    def feed(
        self, source: str, columns: Mapping[str, Floats], dead_time: float
    ) -> Iterator[StreamedStop]:
        """The stops that end in these samples.

        Args:
            source: sender. columns: by name, each (n,), with `t`, `v`, `v_cmd`, `pitch`.
            dead_time: dead time of the brakes [s], so that late brakes are not taken for weak ones.
        """
        stream = self._streams.pop(source, None)
        if stream is None:
            stream = StopStream(dead_time, mount=self._mount, dive=self._dive)
        stream.dead_time = dead_time
        self._streams[source] = stream
        while len(self._streams) > _MAX_STREAMS:
            self._streams.pop(next(iter(self._streams)))
        rows = [columns[name].tolist() for name in ("t", "v", "v_cmd", "pitch")]
        size = len(rows[0])
        grades = columns["grade"].tolist() if "grade" in columns else [math.nan] * size
        for t, v, v_cmd, pitch, grade in zip(*rows, grades, strict=True):
            stop = stream.feed(t, v, v_cmd, pitch, grade)
            if stop is not None:
                yield stop
