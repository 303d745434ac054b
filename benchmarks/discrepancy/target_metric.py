"""A metric: its target, the value reached, and the confidence interval of that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

Target = float | tuple[float, float]


@dataclass(frozen=True, slots=True)
class Metric:
    """One row of the table."""

    what: str  # name of the metric
    relation: str  # ">=" or "<=", "in" for a range, "" without a target
    target: Target  # value or range to reach
    reached: float | None  # share or figure, None without any set
    low: float  # low, high: Wilson interval (95 %) of a share, quartiles of a figure
    high: float
    hits: int  # hits, of: counts behind a share; of alone for a figure
    of: int
    unit: str = "%"  # "%", or unit of the figure

    def record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        values = asdict(self)
        return values | {"wanted": values.pop("target"), "passed": self.passed}

    @property
    def passed(self) -> bool | None:
        """Whether the target is met; None without a target or a figure."""
        if self.reached is None or not self.relation:
            return None
        if isinstance(self.target, tuple):
            return self.target[0] <= self.reached <= self.target[1]
        return self.reached >= self.target if self.relation == ">=" else self.reached <= self.target


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    interval = binomtest(hits, of).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def share(what: str, relation: str, target: Target, answers: Sequence[bool]) -> Metric:
    """A share of sets."""
    hits, of = sum(answers), len(answers)
    return Metric(what, relation, target, hits / of if of else None, *wilson(hits, of), hits, of)


def figure(
    what: str,
    relation: str,
    target: float,
    values: Sequence[float],
    of: Callable[[Any], Any] = np.median,
    unit: str = "",
) -> Metric:
    """A figure over sets, with quartiles."""
    if not values:
        return Metric(what, relation, target, None, 0.0, 0.0, 0, 0, unit)
    low, high = np.quantile(values, (0.25, 0.75))
    reached = float(of(values))
    return Metric(what, relation, target, reached, float(low), float(high), 0, len(values), unit)
