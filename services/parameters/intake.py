"""What may be learned from: each observation once, in order, and of a time that has been.

Duplicates and what comes late change nothing, and everything that is left out is counted by reason.
"""

from __future__ import annotations

import zlib

import msgspec
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.wire.arrival import (
    SenderTable,
    SequenceTracker,
    StampCheck,
    StampVerdict,
    warn_of_order,
)
from slopewise.services.wire.observations import (
    DRIVE_COLUMNS,
    MORE_COLUMNS,
    DriveSamples,
    RobotObservation,
    TerrainLabel,
)
from slopewise.services.wire.recent_warnings import RecentWarnings

_MOST_SOURCES = 1000
_MOST_JUMPED = 4
_INSTANCE = "\x1f"
_MOST_SAMPLES = 20_000
_BOUNDS = {
    "v": 50.0,
    "v_cmd": 50.0,
    "pitch": 1.6,
    "roll": 1.6,
    "grade": 0.8,
    "yaw_rate": 50.0,
    "v_left": 50.0,
    "v_right": 50.0,
    "current_left": 1e4,
    "current_right": 1e4,
    "yaw": 1e3,
    "x": 1e9,
    "y": 1e9,
}
"""Beyond that no robot here goes, leans, turns or draws current [SI]."""


class Intake:
    """Lets through what is new.

    Attributes:
        jumped: sources whose clock was set, and when that was noticed; monotonic clock [s].
        notices: sources that count otherwise than they did.
    """

    def __init__(self, early: float, seen: dict[str, int] | None = None) -> None:
        """Begin.

        Args:
            early: how far a sender's clock may run ahead of the time that passed [s].
            seen: up to which sequence sources were heard before.
        """
        self._early = early
        self._counts = SenderTable[str, SequenceTracker](SequenceTracker, _MOST_SOURCES)
        self._stamps = SenderTable[str, StampCheck](StampCheck, _MOST_SOURCES)
        self.jumped: dict[str, float] = {}
        self.notices = RecentWarnings()
        self._told: tuple[RobotObservation, int] | None = None
        self.heard_before(seen or {})

    def judge(self, kind: str, one: RobotObservation, now: float) -> str:
        """Why an observation is left out: `duplicate`, `out_of_order`, `future`, `late`; or "".

        Args:
            kind: of observation. now: monotonic clock at its arrival [s].
        """
        what = f"{kind} observations of {one.source}"
        count = self._counts.of(_name(kind, one))
        order = count.classify(one.sequence, self._digest(one), one.time - now)
        if not order.is_accepted:
            warn_of_order(self.notices, what, order, is_used=False)
            return order.value.replace(" ", "_")
        verdict = self._stamps.of(one.source).check(one.time - now, self._early)
        if verdict is StampVerdict.CLOCK_SET:
            self.jumped[one.source] = now
            while len(self.jumped) > _MOST_JUMPED:
                self.jumped.pop(next(iter(self.jumped)))
        is_used = verdict in (StampVerdict.PLAUSIBLE, StampVerdict.CLOCK_SET)
        warn_of_order(self.notices, what, order, is_used=is_used)
        return "" if is_used else verdict.value

    def heard_before(self, seen: dict[str, int]) -> None:
        """Take up what was heard in another life."""
        for name, sequence in seen.items():
            count = self._counts.of(name)
            if sequence > count.last:
                count.accept(sequence, 0)

    def heard(self, kind: str, one: RobotObservation) -> dict[str, int]:
        """Remember that it was taken; what the store has to remember with it."""
        name = _name(kind, one)
        self._counts.of(name).accept(one.sequence, self._digest(one))
        return {name: one.sequence}

    def _digest(self, one: RobotObservation) -> int:
        """Of its content; what is judged and then taken is read once."""
        if self._told is None or self._told[0] is not one:
            self._told = (one, _content(one))
        return self._told[1]


def _name(kind: str, one: RobotObservation) -> str:
    """A source that was started anew and says so counts for itself."""
    return f"{kind}:{one.source}" + (f"{_INSTANCE}{one.instance}" if one.instance else "")


def _content(one: RobotObservation) -> int:
    """A digest of what it tells, of a stop or samples whenever they were sent."""
    told = one if isinstance(one, TerrainLabel) else msgspec.structs.replace(one, time=0.0)
    return zlib.crc32(msgspec.msgpack.encode(told, enc_hook=lambda array: array.tobytes()))


def columns_of(samples: DriveSamples, key: str) -> dict[str, Floats]:
    """Columns of drive samples by name, checked.

    Raises:
        InputError: names key and field.
    """
    names, values = samples.columns, samples.values
    known = (*DRIVE_COLUMNS, *MORE_COLUMNS)
    wrong = [name for name in names if name not in known]
    missing = [name for name in DRIVE_COLUMNS if name not in names]
    if wrong or missing or len(set(names)) < len(names):
        words = f"expected {', '.join(DRIVE_COLUMNS)} and any of {', '.join(MORE_COLUMNS)}, once"
        raise InputError(key, "columns", f"{words}, got {', '.join(names)[:200]}")
    if values.ndim != 2 or len(values) != len(names) or not values.shape[1]:
        words = f"expected {len(names)} rows of samples, got shape {values.shape}"
        raise InputError(key, "values", words)
    if values.shape[1] > _MOST_SAMPLES:
        words = f"expected at most {_MOST_SAMPLES} samples, got {values.shape[1]}"
        raise InputError(key, "values", words)
    columns = dict(zip(names, values, strict=True))
    for name, column in columns.items():
        most = _BOUNDS.get(name, 1e12)
        # NaN is never within anything.
        bad = ~(np.abs(column) <= most)
        if bad.any():
            i = int(np.argmax(bad))
            words = f"expected finite numbers of at most {most:g}, got {column[i]}"
            raise InputError(key, f"values.{name}[{i}]", words)
    steps = np.diff(columns["t"])
    if not np.all(steps > 0.0):
        i = int(np.argmin(steps)) + 1
        raise InputError(key, f"values.t[{i}]", "expected a time after that of the sample before")
    return columns
