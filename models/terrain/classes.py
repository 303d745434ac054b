"""Classes of terrain as data: what each of the three features is like on it, and the rules for it.

Source: Slip, Tables 2 (means and spreads), 3 (confidence) and 4 (rules).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities

FEATURES = ("motion_resistance", "lateral_resistance", "slip_track")
CONFIDENCE = {"low": 1.0, "medium": 2.0, "medium-high": 2.5, "high": 3.0}

Confidence = Literal["low", "medium", "medium-high", "high"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureOfClass:
    """One feature on one class of terrain.

    Attributes:
        samples: observations behind mean and spread.
        rule: [low, high] that the expert rules allow; none if they do not ask for this feature.
        confidence: how surely this feature characterises this class.
        decides: an observation that this rule allows is of this class whatever else was measured.
    """

    mean: float = quantity("feature", "Mean over repeated runs.")
    std: float = quantity("feature", "Standard deviation over repeated runs.", above=0.0)
    samples: float = quantity("1", "Observations behind mean and spread.", at_least=2.0)
    rule: tuple[float, float] | None = None
    confidence: Confidence = "medium"
    decides: bool = False

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.rule is not None and not self.rule[0] < self.rule[1]:
            raise ParameterError("rule", f"[low, high], low < high, got {list(self.rule)}")
        if self.confidence not in CONFIDENCE:
            raise ParameterError(
                "confidence", f"one of {', '.join(CONFIDENCE)}, got {self.confidence!r}"
            )
        if self.decides and self.rule is None:
            raise ParameterError("decides", "a rule beside it, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainClass:
    """One class; features that were never measured on it are left out."""

    name: str
    motion_resistance: FeatureOfClass | None = None
    lateral_resistance: FeatureOfClass | None = None
    slip_track: FeatureOfClass | None = None

    def __post_init__(self) -> None:
        if not self.name.strip() or self.name.startswith("#"):
            raise ParameterError("name", f"a name that begins without #, got {self.name!r}")

    @property
    def features(self) -> tuple[FeatureOfClass | None, ...]:
        """In the order of :data:`FEATURES`."""
        return (self.motion_resistance, self.lateral_resistance, self.slip_track)

    def decided(self, values: tuple[float, float, float]) -> bool:
        """Does a feature say by itself that an observation is of this class?

        B_s > 1.4 m is sand "no matter what the other two features are". Source: Slip 4.2.

        Args:
            values: (f_r, μ_t, B_s), NaN where not known.
        """
        return any(
            feature.rule[0] < value <= feature.rule[1]
            for value, feature in zip(values, self.features, strict=True)
            if feature is not None and feature.decides and feature.rule is not None
        )

    def meets(self, values: tuple[float, float, float]) -> float:
        """Share of this class's rules that an observation meets, by confidence [0 … 1].

        Table 4's rules leave gaps and overlap, so none may be met strictly: (0.21, 0.22, 1.29),
        which Table 5 calls plowed, meets two of plowed terrain's three. Each rule counts as much
        as Table 3 trusts its feature for its class. A feature that is not known meets nothing.
        Source: Slip, Tables 3, 4.

        Args:
            values: (f_r, μ_t, B_s), NaN where not known.
        """
        met = asked = 0.0
        for value, feature in zip(values, self.features, strict=True):
            if feature is None or feature.rule is None:
                continue
            weight = CONFIDENCE[feature.confidence]
            asked += weight
            low, high = feature.rule
            met += weight * (low <= value <= high)
        return met / asked if asked else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainClasses:
    """The classes that one vehicle knows."""

    name: str
    terrain: tuple[TerrainClass, ...] = ()

    def __post_init__(self) -> None:
        names = [one.name for one in self.terrain]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("terrain", f"each name once, got {name} twice")


@dataclass(frozen=True, slots=True)
class RuleAnswer:
    """What the expert rules say.

    Attributes:
        name: the class that meets most; empty if none meets anything, or two meet as much.
        met: share of the rules met by class, in the order of the classes.
    """

    name: str
    met: dict[str, float]


def deciding(classes: TerrainClasses, values: tuple[float, float, float]) -> list[str]:
    """Names of the classes that a feature decides for by itself, mostly none."""
    return [one.name for one in classes.terrain if one.decided(values)]


def by_rules(classes: TerrainClasses, values: tuple[float, float, float]) -> RuleAnswer:
    """Class by the expert rules. Source: Slip, Table 4, weighted by Table 3.

    A rule that decides by itself comes first. Source: Slip 4.2.

    Args:
        classes: those without rules take no part.
        values: (f_r, μ_t, B_s), NaN where not known.
    """
    met = {one.name: one.meets(values) for one in classes.terrain}
    met = {name: share for name, share in met.items() if not math.isnan(share)}
    leaders = deciding(classes, values)
    if len(leaders) == 1:
        return RuleAnswer(leaders[0], met)
    best = max(met.values(), default=0.0)
    leaders = [name for name, share in met.items() if share == best]
    return RuleAnswer(leaders[0] if best > 0.0 and len(leaders) == 1 else "", met)
