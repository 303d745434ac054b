"""What ROS 2 tells of a drive, as samples that the service learns braking and ground from."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from uuid import uuid4

import numpy as np
import zenoh

from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.observations import DriveSamples

_FEWEST, _MOST = 10, 200
_STALE = 0.5
"""What is older than that when a sample is taken breaks the row [s]."""


@dataclass
class Now:
    """The last values, each with when it came, monotonic [s]."""

    values: dict[str, tuple[float, float]] = field(default_factory=dict)

    def put(self, at: float, **values: float) -> None:
        """Remember values that came at the same time."""
        for name, value in values.items():
            self.values[name] = (at, value)


class SampleTeller:
    """Collects a sample with each odometry, and sends them in messages."""

    def __init__(self, session: zenoh.Session, namespace: str, columns: tuple[str, ...]) -> None:
        """Tell the service.

        Args:
            session: that reaches it. namespace: of its keys.
            columns: beside t; v, v_cmd and pitch are among them.
        """
        self.now = Now()
        self._columns = columns
        self._rows: list[tuple[float, ...]] = []
        self._source, self._sequence = f"ros-{uuid4().hex[:12]}", 0
        self._publisher = session.declare_publisher(
            f"{namespace}/v1/obs/drive", congestion_control=zenoh.CongestionControl.DROP
        )

    def sample(self, at: float) -> None:
        """Take a sample; a value that is missing or old ends the stretch."""
        values = [self.now.values.get(name) for name in self._columns]
        # The stop command comes once, and holds.
        fresh = all(
            value is not None
            and np.isfinite(value[1])
            and (at - value[0] < _STALE or name == "v_cmd")
            for name, value in zip(self._columns, values, strict=True)
        )
        if fresh and (not self._rows or at > self._rows[-1][0]):
            self._rows.append((at, *(value[1] for value in values if value is not None)))
        if (not fresh and len(self._rows) >= _FEWEST) or len(self._rows) >= _MOST // 4:
            self._send()
        if not fresh:
            self._rows.clear()

    def _send(self) -> None:
        self._sequence += 1
        message = DriveSamples(
            source=self._source,
            sequence=self._sequence,
            time=time.monotonic(),
            columns=["t", *self._columns],
            values=np.array(self._rows).T,
        )
        self._publisher.put(
            codec.encode(message, Format.MESSAGEPACK),
            encoding=codec.encoding_of(DriveSamples, Format.MESSAGEPACK),
        )
        self._rows.clear()
