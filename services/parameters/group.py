"""What each kind of parameter group can do; versions, disk and wire are none of its business.

An estimator is a class of this protocol and a line in
:mod:`slopewise.services.parameters.registry`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model

State = dict[str, Any]
"""What a group keeps over a restart, as plain values.

The history tells the values and standard deviations that lie in `values` and `stds`, by name.
"""


@dataclass(frozen=True, slots=True)
class Description:
    """A group as people and machines read it; see
    ``slopewise.services.wire.parameter_messages``.
    """

    values: dict[str, float]
    valid: bool
    age: float
    stds: dict[str, float] = field(default_factory=dict)
    covariance: list[list[float]] | None = None
    unit: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str | float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GroundNews:
    """What drive samples told of the ground.

    Attributes:
        changed: the ground is another since. features: (f_r, μ_t, B_s) with standard deviations as
            they are known now, NaN where not; None without news.
        valid: the ground is surely of a known class; only then may features make a plan faster.
    """

    changed: bool = False
    features: tuple[tuple[float, float], ...] | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True)
class DriveNews:
    """Samples of a drive, in the order of time.

    Attributes:
        source: who sent them. columns: by name, each (n,) and finite, SI.
        ground: what they told of the ground.
    """

    source: str
    columns: Mapping[str, Floats]
    ground: GroundNews


class ParameterGroups(Protocol):
    """One or several groups of a kind; one thread.

    Attributes:
        of_operators: what was set or adopted holds even where nothing is learned.
    """

    of_operators: bool = False

    def names(self) -> list[str]:
        """All there are."""

    def owns(self, group: str) -> bool:
        """Whether a group is looked after here, even if there is nothing in it yet."""
        return group in self.names()

    def drive(self, samples: DriveNews) -> set[str]:
        """Learn from samples of a drive; the groups that changed."""
        return set()

    def distrust(self) -> set[str]:
        """Be nowhere faster than the model file until something is learned; what changed."""
        return set()

    def apply(self, model: Model) -> Model:
        """A model with these parameters as they are to be planned with."""

    def describe(self, group: str) -> Description:
        """A group as planned with."""

    def state(self, group: str) -> State | None:
        """What a restart needs; None: as in the model file."""

    def restore(self, group: str, state: State | None, age: float) -> None:
        """As it was ``age`` seconds ago; ValueError or KeyError if it cannot have been so."""

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """An operator's values; ParameterError says what was expected."""
