"""What the discrepancy workflow found on the stops that the service keeps, as an offer."""

from __future__ import annotations

import shlex
from typing import Any

import msgspec

from slopewise.services.wire.messages import Message


class Shift(Message, frozen=True):
    """By how much stops become longer, least and most over speeds, grades and surfaces [m].

    Below 0 they become shorter. ``where``: the least, in words.
    """

    least: float
    most: float
    where: str


class Estimated(msgspec.Struct, frozen=True):
    """A number of a finding, its standard deviation and unit; None where it is not known."""

    value: float | None
    std: float | None
    unit: str


class OfferedEffect(msgspec.Struct, frozen=True):
    """A named effect with its parameters by name."""

    name: str
    parameters: dict[str, Estimated]


class DistanceError(msgspec.Struct, frozen=True):
    """How far stopping distances are off on stops held out, root mean square [m]."""

    before: float | None = None
    after: float | None = None
    noise_floor: float | None = None


class FindingNumbers(msgspec.Struct, frozen=True):
    """What people look at first in discrepancy.json."""

    effects: list[OfferedEffect] = []
    stop_distance: DistanceError = DistanceError()


class Offer(Message, frozen=True):
    """A finding that may be adopted.

    Attributes:
        id: of data and model together. at: clock of the day [s]. cause: who asked for it.
        verdict, summary: as in discrepancy.json. findings: all of that file.
        data: fingerprint of the samples. stops: that it rests on.
        beside_file, beside_use: what plans change, beside the model file and beside what was in use
            when it was found, if adopted without more.
        valid: the verdict is sure, and it closes the gap on stops held out.
        changes: there is something to adopt.
        notes: doubts, in sentences. model: the tables of the model that it comes to; left out where
            only the finding is told.
    """

    id: str
    at: float
    cause: str
    verdict: str
    summary: str
    findings: dict[str, Any]
    data: str
    stops: int
    beside_file: Shift
    beside_use: Shift
    valid: bool
    changes: bool
    notes: list[str]
    model: dict[str, Any] = msgspec.field(default_factory=dict)

    @property
    def slower(self) -> bool:
        """No stop becomes shorter than by the model file."""
        return self.beside_file.least >= 0.0

    @property
    def slower_than_now(self) -> bool:
        """Nor than by what was in use."""
        return self.slower and self.beside_use.least >= 0.0

    @property
    def obstacle(self) -> str:
        """Why it would be refused whatever an operator says; "" where it would not."""
        if not self.changes:
            return "nothing to adopt"
        able = self.slower or self.valid
        return "" if able else "neither sure enough to make plans faster, nor slower everywhere"

    def command(self) -> str:
        """What an operator types to adopt it, without where the service is; "" with an obstacle."""
        faster = "" if self.slower else " --faster"
        return "" if self.obstacle else f"slopewise params --adopt {shlex.quote(self.id)}{faster}"

    def told(self) -> FindingNumbers:
        """Its numbers; none where an older release wrote them in another way."""
        try:
            return msgspec.convert(self.findings, FindingNumbers)
        except ValueError:
            return FindingNumbers()

    def words(self) -> str:
        """One line for people."""
        names = ", ".join(effect["name"] for effect in self.findings.get("effects", []))
        by = f"stops {self.beside_file.least:+.2f} … {self.beside_file.most:+.2f} m"
        return f"{self.verdict}{f' {names}' if names else ''}: {by} beside the model file"
