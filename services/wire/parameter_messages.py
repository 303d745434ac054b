"""Messages about parameters: groups with values and standard deviations, requests and changes."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field

from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import Message, Number, Text

Group = Annotated[str, Meta(min_length=1, max_length=80)]


class ParameterGroup(Message, frozen=True):
    """Parameters that change together.

    Attributes:
        group: `braking`, `braking.SURFACE`, `terrain`, `limits` or `effects`.
        version: version of all parameters since which they are unchanged.
        valid: the estimate is reliable; the values used for plans are cautious in any case.
        age: time since they were learned or set [s]. fingerprint: digest of the vehicle's data.
        cause, who: cause and author of the last change, as text.
        values: used for plans, before any margin. stds: standard deviations, where there are any.
        covariance: for braking, of m_m, b_m, m_b, b_b.
        unit: unit by value. notes: further facts, such as the number of accepted stops.
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
    """A stored change; `at` is the wall clock [s since 1970]."""

    version: int
    group: str
    at: float
    cause: str
    who: str
    values: dict[str, float]
    stds: dict[str, float] = field(default_factory=dict)
    valid: bool = False


class ParameterQuestion(Message, frozen=True):
    """Request to read. ``history``: number of past changes to return, newest first."""

    group: Annotated[str, Meta(max_length=80)] = ""
    history: Annotated[int, Meta(ge=0, le=10_000)] = 0


class SetParameters(Message, frozen=True):
    """Values set by an operator; omitted ones are unchanged. ``who``: the operator."""

    group: Group
    values: Annotated[dict[str, float], Meta(min_length=1, max_length=16)]
    who: Text = "operator"


class RollBack(Message, frozen=True):
    """Roll back a group, or all without a name, to a version."""

    version: Number
    group: Annotated[str, Meta(max_length=80)] = ""
    who: Text = "operator"


class AdoptOffer(Message, frozen=True):
    """Plan with the proposed model; ``offer``: its id, ``who``: the operator.

    ``faster``: stops may become shorter than by the model file, if the finding is valid.
    """

    offer: Text
    faster: bool = False
    who: Text = "operator"


class DiscrepancyQuestion(Message, frozen=True):
    """Request for findings; ``start``: examine the stored stops again. ``who``: the operator."""

    start: bool = False
    who: Text = "operator"


class ParameterReply(Message, frozen=True):
    """Reply about parameters; there is always one.

    Attributes:
        status: `ok`, `refused` or `error`. reason: as text. version: parameter version in use.
        durable: the last change is on disk. groups: as requested. history: newest first.
        flags: warnings.
        offer: last finding on stored stops; with its model only if findings were requested.
        investigation: result of their last examination; `investigating` while one is running.
    """

    status: Literal["ok", "refused", "error"]
    reason: str
    service: str
    version: int
    durable: bool
    groups: list[ParameterGroup] = field(default_factory=list)
    history: list[HistoryEntry] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)
    offer: ModelProposal | None = None
    investigation: str = ""
    investigating: bool = False
