"""What the body does when the brakes take hold, which is no effect of the brakes.

A body on springs pitches at the onset and rocks until it lies still, and a speed that is read on it
rocks along by a centimetre or two per second, in all stops alike, the more the harder they brake.
Left to itself that would look like something missing along the time since onset. It is fitted along
as a curve in the first tenths of a second, small by a prior, and is no part of the model.
"""

from __future__ import annotations

import numpy as np

from models.arrays import Floats
from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.thresholds import OSCILLATION_KNOTS, USUAL_PULL

OSCILLATION = len(OSCILLATION_KNOTS) - 2
"""Numbers of the curve."""


def oscillation_columns(table: StopTable, dead_time: float) -> Floats:
    """(S, M, OSCILLATION) change of the fall of speed with each number of the curve [1]."""
    since = table.time - dead_time
    rows = np.eye(len(OSCILLATION_KNOTS))[1:-1]
    hats = np.stack(
        [np.interp(since, OSCILLATION_KNOTS, row, left=0.0, right=0.0) for row in rows], axis=2
    )
    # As the deceleration itself, so that a wrong model of it changes nothing here.
    result: Floats = hats * np.minimum(table.pull / USUAL_PULL, 2.0)[:, None, None]
    return result
