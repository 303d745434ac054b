"""How large an obstacle is against the vehicle's limit, by its own geometry.

Nothing here knows the planner: it looks where a tyre or the body passes over continuous shapes. A
map shows outlines to about a cell, so every case has two sizes: what an obstacle has for sure, if
it is a cell smaller or larger on all sides, and what it may have.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.vehicle import Vehicle

from .shapes import Block

_GRAIN = 0.004  # [m] samples along a wheel's way
_ACROSS = 9
_GRAZE = 0.1  # of the width of a tyre
_BEYOND = 3.0  # [m] of the way that is looked at, before and after


class Size(NamedTuple):
    """Sizes against the limits that apply; 1 is at the limit.

    Attributes:
        step: of what a wheel has to climb or falls. underside: of what stands between the wheels.
        twist: of how far one wheel hangs below the other three.
        beside: half the width of the vehicle against the distance of what stands there, or its
            height against the underside's: the less of both, for both make it too large.
    """

    step: float
    underside: float
    twist: float
    beside: float

    @property
    def worst(self) -> float:
        return max(self)


def size_of(block: Block, vehicle: Vehicle) -> Size:
    """Size of an obstacle for a vehicle that drives along x, its middle on y = 0."""
    shape = vehicle.shape
    if min(block.half_length, block.half_width) <= 0.0:
        return Size(0.0, 0.0, 0.0, 0.0)
    span = block.span_between(-_BEYOND, _BEYOND)
    if span is None:
        return Size(0.0, 0.0, 0.0, 0.0)
    half_track, half_tyre = 0.5 * vehicle.track_width, 0.5 * shape.wheel_width
    step, graze = 0.0, _GRAZE * shape.wheel_width
    for side in (half_track, -half_track):
        inner, outer = side - half_tyre, side + half_tyre
        # A corner that hardly touches the tyre's side is nothing to climb.
        if span[1] <= inner + graze or span[0] >= outer - graze:
            continue
        climb = block.height if block.height > 0.0 else -_wheel_path(block, vehicle, side).min()
        step = max(step, float(climb) / shape.max_step)
    twist = _twist(block, vehicle) / shape.wheel_travel
    if block.height <= 0.0:
        return Size(step, 0.0, twist, 0.0)
    between = half_track - half_tyre
    under = span[0] < between and span[1] > -between
    underside = block.height / shape.clearance if under else 0.0
    near = 0.0 if span[0] <= 0.0 <= span[1] else min(abs(span[0]), abs(span[1]))
    reaches = block.height > shape.clearance
    beside = min(0.5 * shape.width / max(near, 0.05), block.height / shape.clearance)
    beside = beside if reaches else 0.0
    # What the wheels run into is judged by them.
    return Size(step, underside, twist, beside)


def _twist(block: Block, vehicle: Vehicle) -> float:
    """How far one wheel gets below the plane of the other three, or above it [m].

    What no wheel climbs, no wheel stands on.
    """
    if abs(block.height) > 2.0 * vehicle.shape.max_step:
        return 0.0
    left, right = (_wheel_path(block, vehicle, s * 0.5 * vehicle.track_width) for s in (1, -1))
    apart = round(vehicle.wheelbase / _GRAIN)
    off = (left - right)[apart:] - (left - right)[:-apart]
    return float(np.abs(off).max())


def _wheel_path(block: Block, vehicle: Vehicle, side: float) -> Floats:
    """Height of the lowest point of a wheel above the plane along its way [m]."""
    radius, half_tyre = vehicle.wheel_radius, 0.5 * vehicle.shape.wheel_width
    x = np.arange(-_BEYOND, _BEYOND, _GRAIN)
    highest = np.full(len(x), -np.inf)
    for across in np.linspace(side - half_tyre, side + half_tyre, _ACROSS):
        below: Floats = np.where(block.holds(x, np.full(len(x), across)), block.height, 0.0)
        highest = np.maximum(highest, below)
    lowest = highest.copy()
    for n in range(1, int(radius / _GRAIN)):
        rim = radius - np.sqrt(radius**2 - (n * _GRAIN) ** 2)
        lowest[n:] = np.maximum(lowest[n:], highest[:-n] - rim)
        lowest[:-n] = np.maximum(lowest[:-n], highest[n:] - rim)
    return lowest
