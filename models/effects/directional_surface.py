"""Furrows: resistance depends on the heading, F_b/W += k cos 2(yaw − direction)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import EffectLaw, Enters, Parameter, Place, Search
from slopewise.models.effects.stops_seen import StopsSeen


def force_term(place: Place, k: Elementwise, direction: Elementwise) -> Elementwise:
    """Term of F_b/W, k cos 2(yaw − direction) [1], largest along ``direction``."""
    return k * np.cos(2.0 * (place.yaw - direction))


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    twice = 2.0 * stops.yaw
    yield {}, np.stack((np.cos(twice), np.sin(twice)), axis=2)


def _along(cosine: float, sine: float) -> dict[str, float]:
    return {"k": math.hypot(cosine, sine), "direction": 0.5 * math.atan2(sine, cosine)}


EFFECT = EffectLaw(
    missing="resistance depends on heading",
    enters=Enters.GROUND,
    law=force_term,
    parameters={
        "k": Parameter(unit="1", plausible=(-1.5, 1.5), step=0.01),
        "direction": Parameter(unit="rad", plausible=(-7.0, 7.0), step=0.2),
    },
    depends_on=frozenset(("yaw",)),
    axis="heading",
    experiment="stop across the present heading",
    search=Search(columns=_columns, strength="k", one_sided=False, joint=_along),
    max_force=lambda _: {"k": 1.0},
)
