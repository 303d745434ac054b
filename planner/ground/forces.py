"""Bounds of the braking force along candidates, as kernels take them."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.arrays import Bools, Floats


class Forces(NamedTuple):
    """The first arrays of :class:`slopewise.planner.ground.braking_ground.BrakingGround`, in its
    order.
    """

    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats
