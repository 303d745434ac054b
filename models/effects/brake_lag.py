"""The force builds up gradually after the dead time, df/dt = (F − f)/τ with f = 0 at the onset.

Source: Braking Sec. 5.2 names the build-up; a first order is the least that has a time constant.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter


def missing_share(since: Elementwise, tau: Elementwise) -> Elementwise:
    """Share of a constant F still missing since onset or last evaluation, e^(−t/τ), τ > 0."""
    return np.exp(-since / tau)


EFFECT = EffectLaw(
    missing="force builds up gradually after the dead time",
    enters=Enters.LAG,
    law=missing_share,
    parameters={
        "tau": Parameter(
            unit="s",
            plausible=(0.0, 3.0),
            bounds=POSITIVE,
            step=0.1,
            typical=(0.0, 1.0),
            longer_stop=1,
            lighter_rear=-1,
        )
    },
    axis="time_since_onset",
    experiment="log the brake pressure, or the speed at 100 Hz, around the onset",
    unsearched="fitted with every explanation, because every brake builds up its force",
    once=True,
    only_reduces=lambda _: True,
)
