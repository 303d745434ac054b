"""The force changes slowly with time, F_b/W += k t since the session began."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import EffectLaw, Enters, Parameter, Place, Search
from slopewise.models.effects.stops_seen import StopsSeen

_LONGEST = 4.0 * 3600.0  # [s] of a session


def force_term(place: Place, k: Elementwise) -> Elementwise:
    """Term of F_b/W, k t [1]."""
    return k * place.session_time


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    clock = stops.clock[:, None]
    yield {}, clock * np.ones_like(stops.demanded)
    # Brakes that weaken lose a share of their force: the law has its mean.
    yield {}, clock * stops.demanded / np.mean(stops.demanded)


EFFECT = EffectLaw(
    missing="slow change with time",
    enters=Enters.GROUND,
    law=force_term,
    parameters={"k": Parameter(unit="1/s", plausible=(-0.01, 0.01), step=1e-5)},
    depends_on=frozenset(("session_time",)),
    axis="time",
    experiment="repeat these stops much later in the session",
    search=Search(columns=_columns, strength="k", one_sided=False, pauses_distinguish=True),
    max_force=lambda _: {"k": _LONGEST},
    may_add=lambda p: p["k"] > 0.0,
)
