"""Safety offsets for a required coverage, from the errors of held-out predictions.

Each stop is predicted by a fit that has not seen it. The offset is the larger of the conformal
order statistic (the longest shortfall where there are too few stops for one) and a normal
tolerance bound.

Validity: future stops like those of the log, on ground inside the trained ranges.
Source: Braking (11), (12) name the offsets and leave their values open. Conformal order statistic:
Vovk et al. 2005; tolerance bound by the noncentral t distribution: Owen 1968.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from slopewise.models.arrays import Floats

_CONFIDENCE = 0.95
"""Confidence that the tolerance bound covers the required share [1]."""

MIN_STOPS = 5
"""Minimum number of stops for an offset [1]."""

_EXACT = 100
"""Sample size from which the quantile is approximated [1], within 1 %: the noncentral t
underflows."""


def offset_for(coverage: float, shortfall: Floats) -> float:
    """Offset >= 0 that covers the required share of future stops.

    Args:
        coverage: share of stops, below 1.
        shortfall: (n,) actual minus predicted value of stops that the prediction had not seen.

    Raises:
        ValueError: fewer than five stops.
    """
    n = len(shortfall)
    if n < MIN_STOPS:
        raise ValueError(f"an offset takes at least {MIN_STOPS} stops, got {n}")
    rank = min(math.ceil((n + 1) * coverage), n)
    return max(normal_bound(coverage, shortfall), float(np.sort(shortfall)[rank - 1]), 0.0)


def normal_bound(coverage: float, shortfall: Floats) -> float:
    """Upper tolerance bound of a normal distribution behind shortfalls (n,): mean + k std."""
    n = len(shortfall)
    z = float(stats.norm.ppf(coverage))
    if n <= _EXACT:
        k = float(stats.nct.ppf(_CONFIDENCE, n - 1, z * math.sqrt(n))) / math.sqrt(n)
    else:  # the noncentral t underflows; Natrella's approximation is good to a percent from here on
        z_sq = float(stats.norm.ppf(_CONFIDENCE)) ** 2
        a, b = 1.0 - z_sq / (2.0 * (n - 1)), z * z - z_sq / n
        k = (z + math.sqrt(z * z - a * b)) / a
    return float(np.mean(shortfall)) + k * float(np.std(shortfall, ddof=1))
