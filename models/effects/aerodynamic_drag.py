"""Drag of the air, a += c v²: what is missing grows with the speed while it falls.

Source: Braking Sec. 5.2 lists it as neglected; c = ρ c_w A / (2 m). Omits wind: see `headwind`.
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
    """Deceleration c v² [m/s²]."""
    return c * speed * speed


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    yield {}, deceleration(stops.speed, 0.0, 0.0, 1.0) / GRAVITY


EFFECT = EffectLaw(
    missing="drag growing with v(t)²",
    enters=Enters.MOTION,
    law=deceleration,
    parameters={
        "c": Parameter(
            unit="1/m",
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
