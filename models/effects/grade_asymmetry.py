"""Another slope coefficient uphill, F_b/W += k max(θ, 0).

Source: Braking Sec. 2 finds other coefficients uphill than downhill.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import EffectLaw, Enters, Parameter, Place, Search
from slopewise.models.effects.stops_seen import StopsSeen


def force_term(place: Place, k: Elementwise) -> Elementwise:
    """Term of F_b/W, k max(θ, 0) [1]."""
    return k * np.fmax(place.grade, 0.0)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, np.fmax(stops.grade, 0.0)


EFFECT = EffectLaw(
    missing="another slope coefficient uphill",
    enters=Enters.GROUND,
    law=force_term,
    parameters={"k": Parameter(unit="1/rad", plausible=(-5.0, 5.0), step=0.01)},
    axis="grade",
    experiment="stop uphill as well as downhill",
    search=Search(columns=_columns, strength="k", one_sided=False),
    kinks_at_level=True,
    max_force=lambda _: {"k": 0.35},
    per_slope=1.0,
    may_add=lambda p: p["k"] > 0.0,
)
