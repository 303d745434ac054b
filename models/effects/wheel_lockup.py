"""Friction caps the force: all wheels slide at F_b/W = μ cos θ cos φ.

Source and validity: :mod:`slopewise.models.laws.wheel_lockup`, which also knows single axles.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.laws.wheel_lockup import friction_cap

_CAPS = (0.4, 0.6, 0.75, 0.87, 0.95)  # quantiles of the force that the search tries
_MIN_FRICTION = 0.02
"""Lowest friction searched [1]: half of wet ice."""


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    upright = np.cos(stops.grade) * np.cos(stops.roll)
    for mu in np.maximum(np.quantile(stops.given / upright, _CAPS), _MIN_FRICTION):
        yield {"mu": float(mu)}, -np.maximum(stops.given - mu * upright, 0.0)


EFFECT = EffectLaw(
    missing="friction caps the force",
    enters=Enters.CAP,
    law=friction_cap,
    parameters={
        "mu": Parameter(
            unit="1",
            plausible=(0.02, 2.0),
            bounds=POSITIVE,
            step=0.05,
            longer_stop=-1,
            lighter_rear=1,
        )
    },
    axis="grade",
    experiment="stop with less brake: locked wheels give the same force",
    search=Search(columns=_columns, strength="mu", one_sided=True, is_complete=True),
    only_reduces=lambda _: True,
)
