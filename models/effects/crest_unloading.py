"""Over a crest the ground falls away: F_b is multiplied with max(0, 1 − k v² max(0, −κ_v)/g).

Source and validity: :mod:`slopewise.models.laws.crest`. k = 1 where friction decides; with k = 0
only the loads suffer. Acts on what lag, fade and friction leave of the force.
"""

from __future__ import annotations

from collections.abc import Iterator

from slopewise.models.arrays import Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.laws.crest import load_loss, remaining_force


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, -stops.given * load_loss(stops.speed, stops.vertical_curvature)


EFFECT = EffectLaw(
    missing="force falls with the load over a crest",
    enters=Enters.CREST,
    law=remaining_force,
    parameters={
        "k": Parameter(
            unit="1",
            plausible=(0.0, 10.0),
            bounds=POSITIVE,
            default=1.0,
            step=0.05,
            longer_stop=1,
            lighter_rear=-1,
        )
    },
    depends_on=frozenset(("vertical_curvature",)),
    axis="vertical_curvature",
    experiment="stop from the highest speed on a crest, and on even ground of the same slope",
    search=Search(columns=_columns, strength="k", one_sided=True),
    may_add=lambda _: False,
)
