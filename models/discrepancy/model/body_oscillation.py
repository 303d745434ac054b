"""What the body does when the brakes take hold, which is no effect of the brakes.

A body on springs pitches at the onset and rocks until it lies still, and a speed that is read on it
rocks along by a centimetre or two per second, in all stops alike, the more the harder they brake.
Left to itself that would look like something missing along the time since onset. It is fitted along
as a curve in the first tenths of a second, small by a prior, and is no part of the model.

Brakes that build up slowly do so in many shapes. The curve lasts as long as they take, and may be
as large as two shapes differ: which one it is stays open, and the build-up has its name.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.thresholds import (
    LEAST_LAG,
    OSCILLATION_KNOTS,
    OTHER_SHAPE,
    QUICK_BUILD_UP,
    USUAL_OSCILLATION,
    USUAL_PULL,
)


def oscillation_size(lag: float) -> float:
    """Standard deviation of each number of the curve before any data [m/s].

    Args:
        lag: time constant of the build-up [s].
    """
    return USUAL_OSCILLATION + OTHER_SHAPE * max(lag - LEAST_LAG, 0.0)


OSCILLATION = len(OSCILLATION_KNOTS) - 2
"""Numbers of the curve."""


def oscillation_columns(table: StopTable, dead_time: float, lag: float = 0.0) -> Floats:
    """(S, M, OSCILLATION) change of the fall of speed with each number of the curve [1].

    Args:
        table: stops. dead_time: until the onset [s]. lag: time constant of the build-up [s].
    """
    since = (table.time - dead_time) / max(1.0, lag / QUICK_BUILD_UP)
    rows = np.eye(len(OSCILLATION_KNOTS))[1:-1]
    hats = np.stack(
        [np.interp(since, OSCILLATION_KNOTS, row, left=0.0, right=0.0) for row in rows], axis=2
    )
    # As the deceleration itself, so that a wrong model of it changes nothing here.
    result: Floats = hats * np.minimum(table.pull / USUAL_PULL, 2.0)[:, None, None]
    return result
