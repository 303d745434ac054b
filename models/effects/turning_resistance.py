"""Skid steering costs force in a turn, a += g k |κ| v, which is g k |ω_z|.

Validity: slow, steady turns. The form with μ_t is :mod:`slopewise.models.laws.turning_resistance`;
this one needs no tyre forces and is fitted to stops.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.quantity import GRAVITY


def deceleration(
    speed: Elementwise, curvature: Elementwise, yaw: Elementwise, k: Elementwise
) -> Elementwise:
    """Deceleration g k |κ| v [m/s²]."""
    return GRAVITY * (k * np.fabs(curvature)) * speed


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    # A log measures ω_z = κ v; near standstill its quotient with v is noise.
    yield {}, deceleration(1.0, stops.yaw_rate, 0.0, 1.0) / GRAVITY


EFFECT = EffectLaw(
    missing="turning costs force",
    enters=Enters.MOTION,
    law=deceleration,
    parameters={
        "k": Parameter(
            unit="s/rad",
            plausible=(0.0, 2.0),
            bounds=POSITIVE,
            step=0.01,
            longer_stop=-1,
            lighter_rear=1,
        )
    },
    depends_on=frozenset(("turning",)),
    axis="yaw_rate",
    experiment="stop straight, and in turns of several rates",
    search=Search(columns=_columns, strength="k", one_sided=True),
)
