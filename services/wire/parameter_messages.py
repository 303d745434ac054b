"""Messages about parameters: groups with values and standard deviations, requests and changes."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field

from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import Message, Number, Text

Group = Annotated[str, Meta(min_length=1, max_length=80)]


STOP_FACTOR, STOP_FACTOR_QUANTILE = "stop_factor", 0.977
"""Value of a braking group whose calibration promises distances: largest allowed over predicted
distance of the current session at this quantile [1]."""
FORCE_STD = "force_std"
"""Likewise: standard deviation of F_b/W that its promise does not contain [1]."""


class ParameterGroup(Message, frozen=True):
    """Parameters that change together."""

    group: str  # `braking`, `braking.SURFACE`, `terrain`, `limits` or `effects`
    version: int  # version of all parameters since which they are unchanged
    valid: bool  # the estimate is reliable; the values used for plans are cautious in any case
    age: float  # time since they were learned or set [s]
    fingerprint: str  # digest of the vehicle's data
    cause: str  # cause, who: cause and author of the last change, as text
    who: str
    values: dict[str, float]  # used for plans, before any margin
    stds: dict[str, float] = field(default_factory=dict)  # standard deviations, if any
    covariance: list[list[float]] | None = None  # for braking, of m_m, b_m, m_b, b_b
    unit: dict[str, str] = field(default_factory=dict)  # unit by value
    notes: dict[str, str | float] = field(
        default_factory=dict
    )  # such as the number of accepted stops


class HistoryEntry(Message, frozen=True):
    """A stored change."""

    version: int
    group: str
    at: float  # wall clock [s since 1970]
    cause: str
    who: str
    values: dict[str, float]
    stds: dict[str, float] = field(default_factory=dict)
    valid: bool = False


class ParameterQuestion(Message, frozen=True):
    """Request to read."""

    group: Annotated[str, Meta(max_length=80)] = ""
    history: Annotated[int, Meta(ge=0, le=10_000)] = 0  # past changes to return, newest first


class SetParameters(Message, frozen=True):
    """Values set by an operator, ``who``; omitted ones are unchanged."""

    group: Group
    values: Annotated[dict[str, float], Meta(min_length=1, max_length=16)]
    who: Text = "operator"


class RollBack(Message, frozen=True):
    """Roll back a group, or all without a name, to a version."""

    version: Number
    group: Annotated[str, Meta(max_length=80)] = ""
    who: Text = "operator"


class AdoptOffer(Message, frozen=True):
    """Plan with the proposed model."""

    offer: Text  # its id
    faster: bool = False  # stops may become shorter than by the model file, by a valid finding
    who: Text = "operator"


class DiscrepancyQuestion(Message, frozen=True):
    """Request for findings."""

    start: bool = False  # examine the stored stops again
    who: Text = "operator"


class ParameterReply(Message, frozen=True):
    """Reply about parameters; there is always one."""

    status: Literal["ok", "refused", "error"]
    reason: str  # as text
    service: str
    version: int  # parameter version in use
    durable: bool  # the last change is on disk
    groups: list[ParameterGroup] = field(default_factory=list)  # as requested
    history: list[HistoryEntry] = field(default_factory=list)  # newest first
    flags: list[str] = field(default_factory=list)  # warnings
    offer: ModelProposal | None = None  # last finding, with its model if findings were requested
    investigation: str = ""  # result of the last examination of stored stops
    investigating: bool = False  # one is running
