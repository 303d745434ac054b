"""How the model's own force is a little wrong along every stop, which is no missing effect either.

The braking model's force depends on the speed at the onset and is even from there on. That of a
vehicle is a little more or less while it is fast, by its tyres, springs and brakes. Where noise is
low that shows for certain, and takes the name of whatever grows with speed: beside an effect that
is there, or instead of one. It is taken for a slope over the speed within each stop, small by a
prior, wherever explanations are weighed that differ by little else.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.quantity import GRAVITY


def shape_column(table: StopTable, dead_time: float) -> Floats:
    """(S, M) change of the fall of speed by a force that is 1/2 of the weight more at the onset and
    1/2 less at standstill [m/s].

    Args:
        table: stops. dead_time: until the onset [s].
    """
    held = table.held[:, None]
    after = table.time > dead_time
    force = np.where(after, np.clip(table.speed / held, 0.0, 1.0) - 0.5, 0.0)
    step = table.time[:, 1:2] - table.time[:, :1]
    fall = np.zeros_like(force)
    np.cumsum(0.5 * (force[:, 1:] + force[:, :-1]) * step, axis=1, out=fall[:, 1:])
    result: Floats = GRAVITY * fall
    return result
