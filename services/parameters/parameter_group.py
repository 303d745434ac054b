"""Protocol of groups of parameters; versions, disk and wire are handled elsewhere.

An estimator is a class of this protocol and a line in
:mod:`slopewise.services.parameters.group_registry`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from slopewise.models.arrays import Floats
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

    Attributes:
        changed: another terrain was detected.
        features: (f_r, μ_t, B_s) with standard deviations, NaN where unknown; None without news.
    """

    changed: bool = False
    features: tuple[tuple[float, float], ...] | None = None


@dataclass(frozen=True, slots=True)
class DriveUpdate:
    """Samples of a drive in chronological order.

    Attributes:
        source: sender of the samples. columns: SI values by name, each (n,) and finite.
        ground: terrain estimate after them.
    """

    source: str
    columns: Mapping[str, Floats]
    ground: TerrainUpdate


class ParameterGroups(Protocol):
    """One or several groups of a kind; one thread.

    Attributes:
        of_operators: values that were set or adopted hold even where nothing is learned.
    """

    of_operators: bool = False

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

        A roll back restores a shallow copy: replace attributes, change none in place.

        Raises:
            ValueError, KeyError, TypeError: a state that this kind cannot have had.
        """

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Apply an operator's values; ParameterError says what was expected."""
