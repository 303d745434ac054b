"""Classes of terrain as data: means and spreads of the three features, and the paper's rules.

The rules are a table of one vehicle at one site: they hold there. Source: Slip, Tables 2 (means and
spreads), 3 (confidence) and 4 (rules).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import positive, quantity, validate_quantities

FEATURES = ("motion_resistance", "lateral_resistance", "slip_track")
CONFIDENCE = {"low": 1.0, "medium": 2.0, "medium-high": 2.5, "high": 3.0}

Confidence = Literal["low", "medium", "medium-high", "high"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureOfClass:
    """One feature on one class of terrain.

    Attributes:
        samples: runs behind mean and spread; days or sites where there are three of them.
        rule: [low, high] of the expert rules; None if they do not use this feature.
        confidence: how well this feature characterises this class.
        decides: an observation within the rule is of this class by this feature alone.
    """

    mean: float = quantity("feature", "Mean over repeated runs.")
    std: float = positive("feature", "Standard deviation over repeated runs.")
    samples: float = quantity("1", "Runs, or days, behind mean and spread.", at_least=2.0)
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
            raise ParameterError("decides", "a rule as well, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainClass:
    """One class; features that were never measured on it are missing."""

    name: str
    days: float = quantity(
        "1", "Days or sites that it was measured on; a name needs three.", default=1.0, at_least=1.0
    )
    motion_resistance: FeatureOfClass | None = None
    lateral_resistance: FeatureOfClass | None = None
    slip_track: FeatureOfClass | None = None

    def __post_init__(self) -> None:
        validate_quantities(self)
        if not self.name.strip() or self.name.startswith("#"):
            raise ParameterError("name", f"a name that begins without #, got {self.name!r}")

    @property
    def features(self) -> tuple[FeatureOfClass | None, ...]:
        """In the order of :data:`FEATURES`."""
        return (self.motion_resistance, self.lateral_resistance, self.slip_track)

    def is_decided(self, values: tuple[float, float, float]) -> bool:
        """Return True if one feature alone decides that an observation is of this class.

        B_s > 1.4 m is sand "no matter what the other two features are". Source: Slip 4.2.
        ``values``: (f_r, μ_t, B_s), NaN where not known.
        """
        return any(
            feature.rule[0] < value <= feature.rule[1]
            for value, feature in zip(values, self.features, strict=True)
            if feature is not None and feature.decides and feature.rule is not None
        )

    def share_met(self, values: tuple[float, float, float]) -> float:
        """Share of this class's rules that an observation meets, by confidence [0 … 1].

        Table 4's rules leave gaps and overlap, so none may be met strictly: (0.21, 0.22, 1.29),
        which Table 5 calls plowed, meets two of plowed terrain's three. Each rule is weighted by
        Table 3's confidence in its feature. A feature that is not known meets no rule.
        Source: Slip, Tables 3, 4. ``values``: (f_r, μ_t, B_s), NaN where not known.
        """
        met = total = 0.0
        for value, feature in zip(values, self.features, strict=True):
            if feature is None or feature.rule is None:
                continue
            weight = CONFIDENCE[feature.confidence]
            total += weight
            low, high = feature.rule
            met += weight * (low <= value <= high)
        return met / total if total else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainClasses:
    """The classes of one vehicle."""

    name: str
    terrain: tuple[TerrainClass, ...] = ()

    def __post_init__(self) -> None:
        names = [terrain_class.name for terrain_class in self.terrain]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("terrain", f"each name once, got {name} twice")


def by_rules(classes: TerrainClasses, values: tuple[float, float, float]) -> str:
    """Class that meets most of its rules; empty if none meets any, or two meet as much.

    A rule that decides alone comes first (Slip 4.2). Classes without rules never answer.
    Source: Slip, Table 4, weighted by Table 3. ``values``: (f_r, μ_t, B_s), NaN where not known.
    """
    leaders = [terrain.name for terrain in classes.terrain if terrain.is_decided(values)]
    if len(leaders) == 1:
        return leaders[0]
    met = {terrain.name: terrain.share_met(values) for terrain in classes.terrain}
    best = max(met.values(), default=0.0)
    leaders = [name for name, share in met.items() if share == best]
    return leaders[0] if best > 0.0 and len(leaders) == 1 else ""
