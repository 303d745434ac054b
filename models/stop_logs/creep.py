"""How well speeds are held before a stop, from all stops of a log.

The knee of a stop begins with a level whose slope, the creep, may be anything as far as one stop
knows. Where all stops of a log show that speeds are held, the speed at the onset is known better,
and so is the force: the four coefficients come as near to the truth as samples allow.

Source: none; the spread of the creep is a random effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.onset import CREEP, HELD, Knee

_MIN_STOP_COUNT = 30  # stops without which their spread says little about how speeds are held


def held_weights(knees: Sequence[Knee | None], noise: Floats) -> Floats:
    """(n,) weight of the evidence that the speed was held, for :func:`.onset.fit_knee` [s²].

    Args:
        knees: first fits, with the weak weight; None without a fit.
        noise: speed noise of each stop with a fit, correlation included [m/s].
    """
    weights = np.full(len(knees), HELD)
    measured = [knee for knee in knees if knee is not None]
    if len(measured) < _MIN_STOP_COUNT:
        return weights
    creep = np.array([knee.creep for knee in measured])
    std = noise * np.sqrt([knee.creep_variance for knee in measured])
    fit = random_effects.fit(
        np.ones((len(creep), 1)), creep, np.maximum(std, 1e-9), np.zeros(1), np.array([[CREEP**2]])
    )
    # A spread that is not seen may still be as large as chance could hide.
    hidden = float(np.mean(std**2)) * np.sqrt(2.0 / len(creep))
    spread = np.sqrt(fit.scatter**2 + float(fit.coefficients[0]) ** 2 + hidden)
    # A stop that crept unlike all others keeps its creep.
    retained = np.where(fit.kept, np.minimum((noise / spread) ** 2, 1e6), HELD)
    weights[[knee is not None for knee in knees]] = np.maximum(retained, HELD)
    return weights
