"""Classes that an observation agrees with, and the single name where one may be given.

Each kind of motion is compared with each class: f_r of straights, μ_t and B_s of turns, as
logarithms, by Hotelling's T² with a spread pooled over the classes; Fisher's method joins the
kinds. An observation agrees with every class that is not rejected at 5 %.

A class that was measured on one day has the spread of runs of that day. Another day shifts it as
far as another class lies, so that agreement with one class alone is no name: a name needs three
days or sites, whose spread then counts, and both kinds of motion. Omits: covariance of μ_t and B_s,
which terrain files do not hold. Source: Hotelling (1931); Fisher (1932); decision 28.
"""

from __future__ import annotations

import math
from functools import lru_cache

from scipy.special import chdtrc, fdtrc

from slopewise.models.terrain.classes import TerrainClass, TerrainClasses
from slopewise.models.terrain.evidence import EvidenceWindow

ALPHA = 0.05
"""Share of observations of a class that are rejected [1]."""
MIN_DAYS = 3
"""Days or sites behind a name [1]: two give no spread to speak of, and the shift of one day is 2.5
times that of runs."""
KINDS = (("motion",), ("lateral", "slip"))
"""Quantities of straights and of turns."""
_FEATURE = {"motion": 0, "lateral": 1, "slip": 2}


def agreement(classes: TerrainClasses, window: EvidenceWindow) -> dict[str, float]:
    """p-value of each class, 1 where nothing that it has was measured."""
    return {terrain.name: _p_value(classes, terrain, window) for terrain in classes.terrain}


def name_of(classes: TerrainClasses, window: EvidenceWindow, p_values: dict[str, float]) -> str:
    """The one class that agrees, if it was measured on enough days and all kinds were driven."""
    agreeing = [t for t in classes.terrain if p_values[t.name] > ALPHA]
    if len(agreeing) != 1 or agreeing[0].days < MIN_DAYS:
        return ""
    complete = all(any(window.mean(name) is not None for name in kind) for kind in KINDS)
    return agreeing[0].name if complete else ""


def _p_value(classes: TerrainClasses, terrain: TerrainClass, window: EvidenceWindow) -> float:
    logs = []
    for kind in KINDS:
        distance, dimensions, freedom = 0.0, 0, math.inf
        for name in kind:
            feature, mean = terrain.features[_FEATURE[name]], window.mean(name)
            if feature is None or mean is None or feature.mean <= 0.0:
                continue
            variance, pooled = _pooled(classes, _FEATURE[name])
            spread = variance * (1.0 + 1.0 / feature.samples) + mean.variance
            distance += (mean.log - math.log(feature.mean)) ** 2 / spread
            dimensions, freedom = dimensions + 1, min(freedom, pooled)
        if dimensions:
            p_value = float(fdtrc(dimensions, freedom, distance / dimensions))
            logs.append(math.log(max(p_value, 1e-300)))
    return float(chdtrc(2 * len(logs), -2.0 * sum(logs))) if logs else 1.0


@lru_cache(maxsize=64)
def _pooled(classes: TerrainClasses, feature: int) -> tuple[float, float]:
    """Variance of a feature's logarithm within a class, pooled, and its degrees of freedom."""
    given = [t.features[feature] for t in classes.terrain]
    table = [(f.samples - 1.0, (f.std / f.mean) ** 2) for f in given if f and f.mean > 0.0]
    freedom = sum(count for count, _ in table)
    return sum(count * variance for count, variance in table) / freedom, freedom
