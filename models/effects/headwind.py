"""Drag relative to the wind, a += c (|u| u − v²) with u = v + w cos(yaw − direction).

Only what wind adds to the drag of still air, which is `aerodynamic_drag`; from behind it pushes.
Validity: a wind that is the same during the whole log and all along a path.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import (
    ANY,
    POSITIVE,
    EffectLaw,
    Enters,
    Parameter,
    Search,
    Values,
)
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.quantity import GRAVITY

_WINDS = (2.0, 5.0, 10.0)  # [m/s] of the search
_HEADINGS = 12  # of the search
_FASTEST = 10.0
"""No vehicle here is faster, relative to the ground [m/s]."""


def deceleration(
    speed: Elementwise,
    curvature: Elementwise,
    yaw: Elementwise,
    c: Elementwise,
    wind: Elementwise,
    direction: Elementwise,
) -> Elementwise:
    """Deceleration by the wind alone [m/s²], negative from behind; ``direction`` heads into it."""
    relative = speed + wind * np.cos(yaw - direction)
    return c * (np.fabs(relative) * relative - speed * speed)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    for i in range(_HEADINGS):
        direction = 2.0 * np.pi * i / _HEADINGS
        for wind in _WINDS:
            share = deceleration(stops.speed, 0.0, stops.yaw, 1.0, wind, direction) / GRAVITY
            yield {"wind": wind, "direction": direction}, share


def _max_force(values: Values) -> dict[str, float]:
    """Wind helps in one direction and pushes in the other: c (u |u| − v²), u = v + wind cos(…)."""
    c, wind = abs(values["c"]), abs(values["wind"])
    relative = _FASTEST + wind
    return {
        "c": wind * (2.0 * _FASTEST + wind) / GRAVITY,
        "wind": 2.0 * c * relative / GRAVITY,
        "direction": 2.0 * c * relative * wind / GRAVITY,
    }


EFFECT = EffectLaw(
    missing="drag relative to the wind",
    enters=Enters.MOTION,
    law=deceleration,
    parameters={
        "c": Parameter(unit="1/m", plausible=(0.0, 0.5), bounds=POSITIVE, step=0.01),
        "wind": Parameter(
            unit="m/s", plausible=(-60.0, 60.0), bounds=ANY, step=1.0, typical=(0.0, 20.0)
        ),
        "direction": Parameter(unit="rad", plausible=(-7.0, 7.0), bounds=ANY, step=0.2),
    },
    depends_on=frozenset(("yaw",)),
    axis="heading",
    experiment="stop in the opposite direction",
    search=Search(columns=_columns, strength="c", one_sided=True),
    once=True,
    max_force=_max_force,
)
