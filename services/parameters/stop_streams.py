"""Stops in the drive samples of several senders."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.arrival import SenderTable

_MAX_STREAMS = 8  # senders whose streams are followed [1]; a robot has one or two


class StopStreams:
    """One stream of samples per sender, the latest few; one thread."""

    def __init__(self, settings: Learning) -> None:
        mount, dive = settings.mount, settings.dive
        self._streams = SenderTable[str, StopStream](
            lambda: StopStream(0.0, mount=mount, dive=dive), _MAX_STREAMS
        )

    def feed(
        self, source: str, columns: Mapping[str, Floats], dead_time: float
    ) -> Iterator[StreamedStop]:
        """The stops that end in these samples.

        Args:
            source: sender. columns: by name, each (n,), with `t`, `v`, `v_cmd`, `pitch`.
            dead_time: dead time of the brakes [s], so that late brakes are not taken for weak ones.
        """
        stream = self._streams.of(source)
        stream.dead_time = dead_time
        rows = [columns[name].tolist() for name in ("t", "v", "v_cmd", "pitch")]
        size = len(rows[0])
        grades = columns["grade"].tolist() if "grade" in columns else [math.nan] * size
        for t, v, v_cmd, pitch, grade in zip(*rows, grades, strict=True):
            stop = stream.feed(t, v, v_cmd, pitch, grade)
            if stop is not None:
                yield stop
