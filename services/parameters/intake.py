"""What may be learned from: each observation once, in order, and of a time that has been.

Duplicates and what comes late change nothing, and everything that is left out is counted by reason.
"""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from models.arrays import Floats
from models.errors import InputError
from services.wire.observations import DRIVE_COLUMNS, MORE_COLUMNS, DriveSamples, RobotObservation

_MOST_SOURCES = 1000
_LATE = 60.0
"""So much longer on its way than the quickest one, an observation is of a clock set back [s]."""

_JUMPED = 5
"""So many observations in a row that agree with each other are right about a clock."""

_MOST_JUMPED = 4
_MOST_SAMPLES = 20_000
_BOUNDS = {
    "v": 50.0, "v_cmd": 50.0, "pitch": 1.6, "roll": 1.6, "grade": 0.8, "yaw_rate": 50.0,
    "v_left": 50.0, "v_right": 50.0, "current_left": 1e4, "current_right": 1e4,
    "yaw": 1e3, "x": 1e9, "y": 1e9,
}  # fmt: skip
"""Beyond that no robot here goes, leans, turns or draws current [SI]."""


class _Clock:
    """A sender's clock beside the time that passes here."""

    def __init__(self) -> None:
        self.lead = -np.inf
        self._doubtful: list[float] = []

    def judge(self, lead: float, early: float) -> str:
        """Why an observation cannot be of now; empty if it can, "jumped" if the clock was set."""
        if self.lead == -np.inf or self.lead - _LATE <= lead <= self.lead + early:
            self.lead = max(self.lead, lead)
            self._doubtful = []
            return ""
        if self._doubtful and abs(lead - self._doubtful[-1]) > early:
            self._doubtful = []
        self._doubtful.append(lead)
        if len(self._doubtful) >= _JUMPED:
            self.lead, self._doubtful = lead, []
            return "jumped"
        return "future" if lead > self.lead else "late"


class Intake:
    """Lets through what is new.

    Attributes:
        jumped: sources whose clock was set, and when that was noticed; monotonic clock [s].
    """

    def __init__(self, early: float, seen: dict[str, int] | None = None) -> None:
        """Begin.

        Args:
            early: how far a sender's clock may run ahead of the time that passed [s].
            seen: up to which sequence sources were heard before.
        """
        self._early = early
        self._seen = OrderedDict(seen or {})
        self._clocks: OrderedDict[str, _Clock] = OrderedDict()
        self.jumped: dict[str, float] = {}

    def judge(self, kind: str, one: RobotObservation, now: float) -> str:
        """Why an observation is left out: `duplicate`, `out_of_order`, `future`, `late`; or "".

        Args:
            kind: of observation. now: monotonic clock at its arrival [s].
        """
        last = self._seen.get(_name(kind, one.source))
        if last is not None and one.sequence <= last:
            return "duplicate" if one.sequence == last else "out_of_order"
        clock = self._clocks.pop(one.source, None) or _Clock()
        self._clocks[one.source] = clock
        while len(self._clocks) > _MOST_SOURCES:
            self._clocks.popitem(last=False)
        judged = clock.judge(one.time - now, self._early)
        if judged == "jumped":
            self.jumped[one.source] = now
            while len(self.jumped) > _MOST_JUMPED:
                self.jumped.pop(next(iter(self.jumped)))
            return ""
        return judged

    def heard_before(self, seen: dict[str, int]) -> None:
        """Take up what was heard in another life."""
        for name, sequence in seen.items():
            self._seen[name] = max(sequence, self._seen.get(name, -1))

    def heard(self, kind: str, one: RobotObservation) -> dict[str, int]:
        """Remember that it was taken; what the store has to remember with it."""
        name = _name(kind, one.source)
        self._seen.pop(name, None)
        self._seen[name] = one.sequence
        while len(self._seen) > _MOST_SOURCES:
            self._seen.popitem(last=False)
        return {name: one.sequence}


def _name(kind: str, source: str) -> str:
    return f"{kind}:{source}"


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
