"""What each kind of parameter group can do; versions, disk and wire are none of its business."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

State = dict[str, Any]
"""What a group keeps over a restart, as plain values."""


@dataclass(frozen=True, slots=True)
class Description:
    """A group as people and machines read it; see ``services.wire.parameter_messages``."""

    values: dict[str, float]
    valid: bool
    age: float
    stds: dict[str, float] = field(default_factory=dict)
    covariance: list[list[float]] | None = None
    unit: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str | float] = field(default_factory=dict)


class ParameterGroups(Protocol):
    """One or several groups of a kind."""

    def names(self) -> list[str]:
        """All there are."""

    def describe(self, group: str) -> Description:
        """A group as planned with."""

    def state(self, group: str) -> State | None:
        """What a restart needs; None: as in the model file."""

    def restore(self, group: str, state: State | None, age: float) -> None:
        """As it was ``age`` seconds ago; ValueError or KeyError if it cannot have been so."""

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """An operator's values; ParameterError says what was expected."""
