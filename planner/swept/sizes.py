"""Sizes of body and wheels as numbers for compiled code, and what a map can show of them."""

from __future__ import annotations

import math
from typing import NamedTuple

from slopewise.models.vehicle import Vehicle

_STEPS_PER_RADIUS = 6
"""Samples of a wheel's path per radius [1]: between two an edge is missed by 0.4 % of the
radius."""
_SHOWN = 0.9
"""Share of a step that a map shows: the cells on its edge lie in between."""

_SLOPE_SHARE = 0.03
"""Share of the slope around a wheel that clears no climb [1]."""

DIAGONAL = 1.42
"""Diagonal of a square over its edge, rounded up [1]: the four cells around a point are nearer."""

_TREND = 2.5
"""Length of ground before and after a step that shows its trend, in wheel radii."""


class SweptSizes(NamedTuple):
    """Lengths [m] unless stated otherwise; heights above or below the plane of the wheels.

    Attributes:
        half_length, half_width: rectangle of the wheels.
        front, rear, side: ends of the body from the middle of the wheelbase.
        margin: half a cell, by which the body is wider: a cell that it touches counts.
        touch: half the diagonal of a cell: one that is farther from the body is not touched by it.
        clearance: underside's. wheel_travel: see :class:`slopewise.models.vehicle.Shape`.
        radius, half_tyre: wheel radius, half the width of a wheel.
        max_step: see :class:`slopewise.models.vehicle.Shape`.
        stride: between samples of the ground under a wheel.
        chord: distance ahead over which the wheel's climb is measured. steepest: the highest
            climb of its centre within that distance that is no step. cleared: a climb up to
            this, beyond the slope around it, needs no exact search.
        trend: ground before and after a step from which its slope follows.
        tyres: samples across a tyre [1].
        fine: the map shows what a wheel feels.
    """

    half_length: float
    half_width: float
    front: float
    rear: float
    side: float
    margin: float
    touch: float
    clearance: float
    wheel_travel: float
    radius: float
    half_tyre: float
    max_step: float
    stride: float
    chord: float
    steepest: float
    cleared: float
    trend: float
    tyres: int
    fine: bool


def swept_sizes(vehicle: Vehicle, resolution: float) -> SweptSizes:
    """Sizes of a vehicle on a map.

    A wheel of radius R that meets a face of height h begins to climb c = √(R² − (R − h)²) before
    it, and its centre runs on a circle around the edge. So it climbs √(R² − (c − d)²) − (R − h)
    within the first d, with any ground behind the edge: a step is distinguished by how steep its
    climb begins, and a ramp that the wheel rolls up is no step.

    Args:
        vehicle: with its shape.
        resolution: edge of a cell of the map [m].
    """
    shape, radius = vehicle.shape, float(vehicle.wheel_radius)
    fine = resolution <= radius
    stride = min(radius / _STEPS_PER_RADIUS, resolution)
    step = min(shape.max_step, radius)
    strides = max(round(0.5 * radius / stride), 1)
    seen = strides * stride
    # The wheel may begin to climb up to one stride after the sample before it.
    chord = seen + stride
    return SweptSizes(
        half_length=0.5 * vehicle.wheelbase,
        half_width=0.5 * vehicle.track_width,
        front=shape.front,
        rear=shape.rear,
        side=0.5 * shape.width,
        margin=0.5 * resolution if fine else 0.0,
        touch=0.5 * DIAGONAL * resolution,
        clearance=shape.clearance,
        # Cells as large as the vehicle is long differ by more than that through noise alone.
        wheel_travel=shape.wheel_travel if fine else math.inf,
        radius=radius,
        half_tyre=0.5 * shape.wheel_width,
        max_step=shape.max_step,
        stride=stride,
        chord=chord,
        steepest=_climb(radius, _SHOWN * step, seen),
        cleared=_climb(radius, step, seen) - _SLOPE_SHARE * chord,
        trend=round(_TREND * radius / stride) * stride,
        tyres=math.ceil(shape.wheel_width / resolution) + 1,
        fine=fine,
    )


def _climb(radius: float, step: float, within: float) -> float:
    """Height that a wheel's centre climbs within a distance after it meets a step [m]."""
    contact = math.sqrt(radius**2 - (radius - step) ** 2)
    return math.sqrt(radius**2 - (contact - min(within, contact)) ** 2) - (radius - step)
