"""The force changes with roll to either side, F_b/W += k |φ|."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import EffectLaw, Enters, Parameter, Place, Search
from slopewise.models.effects.stops_seen import StopsSeen


def force_term(place: Place, k: Elementwise) -> Elementwise:
    """Term of F_b/W, k |φ| [1]."""
    return k * np.fabs(place.roll)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, np.fabs(stops.roll)


EFFECT = EffectLaw(
    missing="force changes with roll",
    enters=Enters.GROUND,
    law=force_term,
    parameters={"k": Parameter(unit="1/rad", plausible=(-5.0, 5.0), step=0.01)},
    depends_on=frozenset(("roll",)),
    axis="roll",
    experiment="stop along the slope leaning to the other side, and without leaning",
    search=Search(columns=_columns, strength="k", one_sided=False),
    kinks_at_level=True,
    max_force=lambda _: {"k": 0.35},
    per_slope=1.0,
    only_reduces=lambda p: p["k"] <= 0.0,
)
