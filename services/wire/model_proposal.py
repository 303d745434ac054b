"""Proposed model changes: results of the discrepancy workflow on stored stops."""

from __future__ import annotations

import shlex
from typing import Any, ClassVar

import msgspec

from slopewise.services.wire.plan_messages import Message


class StopDistanceChange(Message, frozen=True):
    """Change of stopping distances over speeds, grades and surfaces; positive: longer."""

    least: float  # smallest change [m]; words: ok
    most: float  # largest change [m]; words: ok
    where: str  # place of the smallest


class Estimated(msgspec.Struct, frozen=True):
    """A number of a finding, its standard deviation and unit; None if unknown."""

    value: float | None
    std: float | None
    unit: str


class OfferedEffect(msgspec.Struct, frozen=True):
    """A named effect with its parameters by name."""

    name: str
    parameters: dict[str, Estimated]


class DistanceError(msgspec.Struct, frozen=True):
    """Error of stopping distances on held-out stops, root mean square [m]."""

    before: float | None = None
    after: float | None = None
    noise_floor: float | None = None


class FindingNumbers(msgspec.Struct, frozen=True):
    """Main numbers of discrepancy.json."""

    effects: list[OfferedEffect] = []
    stop_distance: DistanceError = DistanceError()


class ModelProposal(Message, frozen=True):
    """A finding that may be adopted; its schema is called ``offer``."""

    SCHEMA: ClassVar[str] = "offer"

    id: str  # of data and model together
    at: float  # wall clock [s]
    cause: str  # who requested it
    verdict: str  # verdict, summary: as in discrepancy.json
    summary: str
    findings: dict[str, Any]  # that file's content
    data: str  # fingerprint of the samples
    stops: int  # number of stops used
    beside_file: StopDistanceChange  # stops compared with those of the model file; words: ok
    beside_use: StopDistanceChange  # and of the parameters in use when it was found; words: ok
    valid: bool  # the verdict is conclusive, and reduces the error on held-out stops
    changes: bool  # it contains a change to adopt
    notes: list[str]  # reservations, in sentences
    model: dict[str, Any] = msgspec.field(default_factory=dict)  # tables of the resulting model

    @property
    def slower(self) -> bool:
        """Return True if no stop becomes shorter than by the model file."""
        return self.beside_file.least >= 0.0

    @property
    def slower_than_now(self) -> bool:
        """Return True if no stop becomes shorter than by the parameters in use either."""
        return self.slower and self.beside_use.least >= 0.0

    @property
    def obstacle(self) -> str:
        """Reason for which no operator can adopt it, empty without one."""
        if not self.changes:
            return "nothing to adopt"
        able = self.slower or self.valid
        return "" if able else "neither conclusive enough for faster plans, nor slower everywhere"

    def command(self) -> str:
        """Command that adopts it, without options of the service's address; "" with an obstacle."""
        faster = "" if self.slower else " --faster"
        return "" if self.obstacle else f"slopewise params --adopt {shlex.quote(self.id)}{faster}"

    def numbers(self) -> FindingNumbers:
        """Numbers of the finding; none where an older release wrote another format."""
        try:
            return msgspec.convert(self.findings, FindingNumbers)
        except ValueError:
            return FindingNumbers()

    def text(self) -> str:
        """Summary in one line."""
        names = ", ".join(effect["name"] for effect in self.findings.get("effects", []))
        by = f"stops {self.beside_file.least:+.2f} … {self.beside_file.most:+.2f} m"
        return f"{self.verdict}{f' {names}' if names else ''}: {by} compared with the model file"
