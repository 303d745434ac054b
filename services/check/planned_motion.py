"""Planned motion between the rows of a plan: speed, acceleration, and where it moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.plan_line import Line


class Motion(NamedTuple):
    """Motion at M samples; arrays are (M,).

    Attributes:
        speed, accel: [m/s], [m/s²]; the acceleration holds from its sample on.
        moving: the plan moves there. excused: it brakes down from a start that was too fast.
    """

    speed: Floats
    accel: Floats
    accel_before: Floats
    moving: Bools
    excused: Bools


def motion_along(line: Line, station: Floats, speed: Floats, status: str) -> Motion:
    """The motion of a plan with speeds (N,) at its rows, v² linear between them."""
    at_rows = station[line.at_row]
    energy = line.between(speed * speed)
    accel = 0.5 * np.diff(speed * speed) / np.diff(at_rows)
    after = np.append(accel, 0.0)[line.row]
    before = after.copy()
    before[line.at_row[1:]] = accel
    energy[line.driven :] = 0.0
    moving = energy > 0.0
    braking_down = np.minimum.accumulate(after < 0.0)
    braking_down[1:] |= braking_down[:-1]  # up to where it ends
    excused = braking_down & (status in ("degraded", "infeasible"))
    return Motion(np.sqrt(energy), after, before, moving, excused)
