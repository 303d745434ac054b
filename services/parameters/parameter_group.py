"""Protocol of groups of parameters; versions, disk and wire are handled elsewhere.

An estimator is a class of this protocol and a line in
:mod:`slopewise.services.parameters.group_registry`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model

State = dict[str, Any]
"""State of a group over a restart, as plain values.

The history shows the values and standard deviations that lie in `values` and `stds`, by name.
"""


@dataclass(frozen=True, slots=True)
class GroupDescription:
    """Content of a group's message, see ``slopewise.services.wire.parameter_messages``."""

    values: dict[str, float]
    valid: bool
    age: float
    stds: dict[str, float] = field(default_factory=dict)
    covariance: list[list[float]] | None = None
    unit: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str | float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TerrainUpdate:
    """Terrain estimate after drive samples.

    ``features``: (f_r, μ_t, B_s) with standard deviations, NaN where unknown; None without news.
    """

    changed: bool = False  # another terrain was detected
    features: tuple[tuple[float, float], ...] | None = None


@dataclass(frozen=True, slots=True)
class DriveUpdate:
    """Samples of a drive in chronological order."""

    source: str  # sender of the samples
    columns: Mapping[str, Floats]  # SI values by name, each (n,) and finite
    ground: TerrainUpdate  # terrain estimate after them


class ParameterGroups(Protocol):
    """One or several groups of a kind; one thread."""

    of_operators: bool = False  # values that were set hold even where nothing is learned

    def names(self) -> list[str]:
        """All groups of this kind."""

    def owns(self, group: str) -> bool:
        """Return True if a group is of this kind, even while it is empty."""
        return group in self.names()

    def drive(self, samples: DriveUpdate) -> set[str]:
        """Learn from samples of a drive; the groups that changed."""
        return set()

    def restrict_to_file(self) -> set[str]:
        """Be nowhere faster than the model file until something is learned; the groups changed."""
        return set()

    def apply(self, model: Model) -> Model:
        """A model with these parameters in their planning form."""

    def describe(self, group: str) -> GroupDescription:
        """A group in its planning form."""

    def state(self, group: str) -> State | None:
        """State for a restart; None: as in the model file."""

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Replace a group by its state of ``age`` seconds ago, whole or not at all.

        A roll back restores a shallow copy: replace attributes, change none in place. A state that
        this kind cannot have had is a ValueError, KeyError or TypeError.
        """

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Apply an operator's values; ParameterError says what was expected."""


class ValueGroup(ParameterGroups):
    """A group of single numbers by name, each with a unit and a range."""

    name: ClassVar[str]
    units: ClassVar[dict[str, str]]

    def __init__(self) -> None:
        self._values: dict[str, float] = {}
        self._updated = time.monotonic()

    def names(self) -> list[str]:
        return [self.name]

    def state(self, group: str) -> State | None:
        return {"values": self._values} if self._values else None

    def set(self, group: str, values: Mapping[str, float]) -> None:
        self._check(values)
        self._replace({**self._values, **values}, 0.0)

    def _replace(self, values: dict[str, float], age: float) -> None:
        """Use values of ``age`` seconds ago."""
        self._values, self._updated = values, time.monotonic() - age

    def _age(self) -> float:
        return time.monotonic() - self._updated if self._values else 0.0

    def _check(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            if name not in self.units:
                raise ParameterError(name, f"one of {', '.join(self.units)}")
            low, high = self._range(name)
            if not low <= value <= high:
                raise ParameterError(name, f"{self._expected(name, low, high)}, got {value:g}")

    def _range(self, name: str) -> tuple[float, float]:
        raise NotImplementedError

    def _expected(self, name: str, low: float, high: float) -> str:
        return f"{low:g} … {high:g} {self.units[name]}"
