"""Do probabilities mean what they say: shares of right answers beside what was said.

Source: reliability curves and expected calibration error, Naeini and others (2015).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats

_BINS = 10
"""Bins of probability of the calibration curve [1]; the usual ten of expected calibration
errors."""


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Answers of about one probability.

    Attributes:
        said: their mean probability. right: share of them that are right. count: of them.
    """

    said: float
    right: float
    count: int


def reliability_curve(said: Floats, right: Bools) -> tuple[ReliabilityBin, ...]:
    """Answers in tenths of probability, empty tenths left out.

    Args:
        said: (n,) probability of each answer. right: (n,) whether it was right.
    """
    place = np.clip((said * _BINS).astype(np.int64), 0, _BINS - 1)
    found = []
    for k in range(_BINS):
        own = place == k
        if own.any():
            found.append(
                ReliabilityBin(float(said[own].mean()), float(right[own].mean()), int(own.sum()))
            )
    return tuple(found)


def expected_calibration_error(said: Floats, right: Bools) -> float:
    """Mean distance between what is said and what is right, by tenths; NaN without answers."""
    curve = reliability_curve(said, right)
    count = sum(one.count for one in curve)
    if not count:
        return float("nan")
    return sum(one.count * abs(one.said - one.right) for one in curve) / count
