"""Parameters on the wire: groups with values and standard deviations, questions and changes."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field

from slopewise.services.wire.messages import Message, Number, Text
from slopewise.services.wire.offer import Offer

Group = Annotated[str, Meta(min_length=1, max_length=80)]


class ParameterGroup(Message, frozen=True):
    """Parameters that change together.

    Attributes:
        group: `braking`, `braking.SURFACE`, `terrain`, `limits` or `effects`.
        version: since which they are so; of all parameters together. valid: the estimate may be
            trusted; what is planned with is cautious either way.
        age: since they were learned or set [s]. fingerprint: of the vehicle.
        cause, who: of the last change, in words.
        values: as planned with, before any margin. stds: standard deviations; missing where nothing
            scatters. covariance: for braking, of m_m, b_m, m_b, b_b.
        unit: of each value. notes: further facts, such as how many stops were believed.
    """

    group: str
    version: int
    valid: bool
    age: float
    fingerprint: str
    cause: str
    who: str
    values: dict[str, float]
    stds: dict[str, float] = field(default_factory=dict)
    covariance: list[list[float]] | None = None
    unit: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str | float] = field(default_factory=dict)


class HistoryEntry(Message, frozen=True):
    """A change that was kept; `at` is a clock of the day [s since 1970]."""

    version: int
    group: str
    at: float
    cause: str
    who: str
    values: dict[str, float]
    stds: dict[str, float] = field(default_factory=dict)
    valid: bool = False


class ParameterQuestion(Message, frozen=True):
    """What to read. ``history``: how many changes of the past are wanted, newest first."""

    group: Annotated[str, Meta(max_length=80)] = ""
    history: Annotated[int, Meta(ge=0, le=10_000)] = 0


class SetParameters(Message, frozen=True):
    """An operator's own values; those left out stay as they are. ``who``: the operator."""

    group: Group
    values: Annotated[dict[str, float], Meta(min_length=1, max_length=16)]
    who: Text = "operator"


class RollBack(Message, frozen=True):
    """Back to how a group, or all without a name, was at a version."""

    version: Number
    group: Annotated[str, Meta(max_length=80)] = ""
    who: Text = "operator"


class AdoptOffer(Message, frozen=True):
    """Plan with the finding that is offered; ``offer``: its id, ``who``: the operator.

    ``faster``: stops may become shorter than by the model file, if the finding is valid.
    """

    offer: Text
    faster: bool = False
    who: Text = "operator"


class DiscrepancyQuestion(Message, frozen=True):
    """What the stored stops say; ``start``: look at them anew. ``who``: the operator."""

    start: bool = False
    who: Text = "operator"


class ParameterReply(Message, frozen=True):
    """The answer about parameters; there is always one.

    Attributes:
        status: `ok`, `refused` or `error`. reason: in words. version: of the parameters in use.
        durable: the last change is on disk. groups: asked for. history: newest first.
        flags: what is not as it should be.
        offer: the last finding on stored stops; its model only where findings were asked for.
        investigation: what the last look at them came to; `investigating` while it goes on.
    """

    status: Literal["ok", "refused", "error"]
    reason: str
    service: str
    version: int
    durable: bool
    groups: list[ParameterGroup] = field(default_factory=list)
    history: list[HistoryEntry] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)
    offer: Offer | None = None
    investigation: str = ""
    investigating: bool = False
