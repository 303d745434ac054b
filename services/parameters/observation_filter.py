"""Filter of observations: each one once, in order, and of a time that has passed.

Duplicates and late ones change nothing, and everything that is excluded is counted by reason.
"""

from __future__ import annotations

import zlib

import msgspec
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.parameters.store import MAX_SOURCES
from slopewise.services.wire.arrival import (
    SenderTable,
    SequenceTracker,
    StampCheck,
    StampVerdict,
    warn_of_order,
)
from slopewise.services.wire.observations import (
    DRIVE_COLUMNS,
    MAX_SAMPLES,
    MORE_COLUMNS,
    DriveSamples,
    RobotObservation,
    TerrainLabel,
)
from slopewise.services.wire.recent_warnings import RecentWarnings

_INSTANCE = "\x1f"  # separates a source's name from its instance; no name contains it

_BOUNDS = (
    dict.fromkeys(("v", "v_cmd", "v_left", "v_right", "yaw_rate"), 50.0)
    | dict.fromkeys(("current_left", "current_right"), 1e4)
    | {"pitch": 1.6, "roll": 1.6, "grade": 0.8, "yaw": 1e3, "x": 1e9, "y": 1e9}
)
"""Beyond speeds, angles, rates and currents of any robot [SI]."""

_OTHER_BOUND = 1e12  # bound of the time [s]: beyond any clock


class ObservationFilter:
    """Accepts what is new; one thread."""

    def __init__(self, early: float, seen: dict[str, int] | None = None) -> None:
        """Continue from numbers ``seen``; senders' clocks may be ``early`` by that [s]."""
        self._early = early
        self._sequences = SenderTable[str, SequenceTracker](SequenceTracker, MAX_SOURCES)
        self._stamps = SenderTable[str, StampCheck](StampCheck, MAX_SOURCES)
        self._last_digest: tuple[RobotObservation, int] | None = None
        self.clocks = RecentWarnings()  # about clocks that were set
        self.notices = RecentWarnings()  # about counts that restarted or go backwards
        self.restore(seen or {})

    def check(self, kind: str, observation: RobotObservation, now: float) -> str:
        """Reason to exclude an observation: duplicate, out_of_order, future or late; or ""."""
        source, lead = observation.source, observation.time - now
        what = f"{kind} observations of {source}"
        sequence = self._sequences.of(_name(kind, observation))
        order = sequence.classify(observation.sequence, self._digest(observation), lead)
        if not order.is_accepted:
            warn_of_order(self.notices, what, order, is_used=False)
            return order.value.replace(" ", "_")
        verdict = self._stamps.of(source).check(lead, self._early)
        if verdict is StampVerdict.CLOCK_SET:
            self.clocks.add(f"the clock of {source} was set")
        is_used = verdict in (StampVerdict.PLAUSIBLE, StampVerdict.CLOCK_SET)
        warn_of_order(self.notices, what, order, is_used=is_used)
        return "" if is_used else verdict.value

    def accept(self, kind: str, observation: RobotObservation) -> dict[str, int]:
        """Record that it was processed; the numbers to store with its result."""
        name = _name(kind, observation)
        self._sequences.of(name).accept(observation.sequence, self._digest(observation))
        return {name: observation.sequence}

    def restore(self, seen: dict[str, int]) -> None:
        """Continue from stored sequence numbers, where they are ahead."""
        for name, sequence in seen.items():
            known = self._sequences.of(name)
            if sequence > known.last:
                known.accept(sequence, 0)

    def _digest(self, observation: RobotObservation) -> int:
        """Digest of its content; one that is checked and then accepted is encoded once."""
        if self._last_digest is None or self._last_digest[0] is not observation:
            self._last_digest = (observation, _content(observation))
        return self._last_digest[1]


def _name(kind: str, observation: RobotObservation) -> str:
    """Name of a sequence of numbers; each instance of a source has a separate one."""
    instance = f"{_INSTANCE}{observation.instance}" if observation.instance else ""
    return f"{kind}:{observation.source}{instance}"


def _content(observation: RobotObservation) -> int:
    """Digest of the content; stops and samples are the same at any time of sending."""
    timed = isinstance(observation, TerrainLabel)
    content = observation if timed else msgspec.structs.replace(observation, time=0.0)
    return zlib.crc32(msgspec.msgpack.encode(content, enc_hook=lambda array: array.tobytes()))


def columns_of(samples: DriveSamples, key: str) -> dict[str, Floats]:
    """Columns of drive samples by name, validated."""
    names, values = samples.columns, samples.values
    known = (*DRIVE_COLUMNS, *MORE_COLUMNS)
    unknown = [name for name in names if name not in known]
    missing = [name for name in DRIVE_COLUMNS if name not in names]
    if unknown or missing or len(set(names)) < len(names):
        expected = f"expected {', '.join(DRIVE_COLUMNS)} and any of {', '.join(MORE_COLUMNS)}, once"
        raise InputError(key, "columns", f"{expected}, got {', '.join(names)[:200]}")
    if values.ndim != 2 or len(values) != len(names) or not values.shape[1]:
        expected = f"expected {len(names)} rows of samples, got shape {values.shape}"
        raise InputError(key, "values", expected)
    if values.shape[1] > MAX_SAMPLES:
        expected = f"expected at most {MAX_SAMPLES} samples, got {values.shape[1]}"
        raise InputError(key, "values", expected)
    columns = dict(zip(names, values, strict=True))
    for name, column in columns.items():
        limit = _BOUNDS.get(name, _OTHER_BOUND)
        # NaN is within no limit.
        beyond = ~(np.abs(column) <= limit)  # words: ok
        if beyond.any():
            i = int(np.argmax(beyond))
            expected = f"expected finite numbers of at most {limit:g}, got {column[i]}"
            raise InputError(key, f"values.{name}[{i}]", expected)
    steps = np.diff(columns["t"])
    if not np.all(steps > 0.0):
        i = int(np.argmin(steps)) + 1
        raise InputError(key, f"values.t[{i}]", "expected a time after that of the sample before")
    return columns
