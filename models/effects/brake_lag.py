"""The force builds up gradually after the dead time, df/dt = (F − f)/τ with f = 0 at the onset.

Source: Braking Sec. 5.2 names the build-up; a first order is the least that has a time constant.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from models.arrays import Elementwise, Floats
from models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from models.effects.stops_seen import StopsSeen

_LAGS = (0.02, 0.04, 0.07, 0.11, 0.17, 0.26, 0.4)  # [s] of the search


def missing_share(since: Elementwise, tau: Elementwise) -> Elementwise:
    """Share of a constant F that is still missing, e^(−t/τ).

    Args:
        since: time t since the onset, or since the force was last looked at [s]. tau: [s], > 0.
    """
    return np.exp(-since / tau)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    for tau in _LAGS:
        yield {"tau": tau}, -stops.built * missing_share(stops.since, tau) * stops.passes


EFFECT = EffectLaw(
    missing="force builds up gradually after the dead time",
    enters=Enters.LAG,
    law=missing_share,
    parameters={
        "tau": Parameter(
            unit="s", bounds=POSITIVE, step=0.1, usual=(0.0, 1.0), longer_stop=1, lighter_rear=-1
        )
    },
    axis="time_since_onset",
    experiment="log the brake pressure, or the speed at 100 Hz, around the onset",
    search=Search(columns=_columns, strength="tau", one_sided=True, whole=True, shape="speed"),
    once=True,
    only_takes=lambda _: True,
)
