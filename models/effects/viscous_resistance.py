"""Resistance in proportion to the speed, a += g c v: oil, wet soil, motors that brake as they turn.

The base knows the speed at onset only; this falls with v(t) during the stop.
"""

from __future__ import annotations

from collections.abc import Iterator

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.quantity import GRAVITY


def deceleration(
    speed: Elementwise, curvature: Elementwise, yaw: Elementwise, c: Elementwise
) -> Elementwise:
    """Deceleration g c v [m/s²]."""
    return GRAVITY * c * speed


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, deceleration(stops.speed, 0.0, 0.0, 1.0) / GRAVITY


EFFECT = EffectLaw(
    missing="loss growing with v(t)",
    enters=Enters.MOTION,
    law=deceleration,
    parameters={
        "c": Parameter(
            unit="s/m",
            plausible=(0.0, 0.5),
            bounds=POSITIVE,
            step=0.01,
            longer_stop=-1,
            lighter_rear=1,
        )
    },
    axis="speed",
    experiment="coast from the highest speed",
    search=Search(columns=_columns, strength="c", one_sided=True),
)
