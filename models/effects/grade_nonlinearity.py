"""The force bends away from the line over the slope, F_b/W += k θ|θ|."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import EffectLaw, Enters, Parameter, Place, Search
from slopewise.models.effects.stops_seen import StopsSeen


def force_term(place: Place, k: Elementwise) -> Elementwise:
    """Term of F_b/W, k θ|θ| [1]."""
    return k * place.grade * np.fabs(place.grade)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, stops.grade * np.fabs(stops.grade)


EFFECT = EffectLaw(
    missing="slope dependence bends away",
    enters=Enters.GROUND,
    law=force_term,
    parameters={"k": Parameter(unit="1/rad²", plausible=(-20.0, 20.0), step=0.01)},
    axis="grade",
    experiment="stop on steeper ground, up and down",
    search=Search(columns=_columns, strength="k", one_sided=False),
    max_force=lambda _: {"k": 0.12},
    per_slope=0.7,
)
