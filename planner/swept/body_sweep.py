"""The body of one pose against the ground under and beside it, and ground that nobody saw."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.ground.bilinear import height_at
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.swept.findings import Finding, Kind
from slopewise.planner.swept.sizes import DIAGONAL, SweptSizes
from slopewise.planner.swept.wheel_path import Ground, Pose, place

_NOTHING, _UNKNOWN, _UNDERSIDE = int(Kind.NOTHING), int(Kind.UNKNOWN), int(Kind.UNDERSIDE)
_FRONT, _REAR, _SIDE = int(Kind.FRONT), int(Kind.REAR), int(Kind.SIDE)

_PER_CELL = 10.0
"""Points of the outline to a cell [1]: between two the ground is higher by a twentieth of the
difference of two cells at most."""


@inlined
def _extent(centre: float, along: float, across: float, sizes: SweptSizes) -> tuple[float, float]:
    """Lowest and highest coordinate of the body [m].

    Args:
        centre: of the pose. along, across: this coordinate of the vectors ahead and to the left.
        sizes: of the vehicle.
    """
    ahead, behind = sizes.front * along, -sizes.rear * along
    half = sizes.side * abs(across)
    return centre + min(ahead, behind) - half, centre + max(ahead, behind) + half


class _Plane(NamedTuple):
    """Plane of the wheels: height in the middle [m], rise ahead and to the left [1]."""

    level: float
    rise: float
    cross_slope: float


class _Highest(NamedTuple):
    """Highest ground above the plane of the wheels, 0 without any [m], and where it is.

    Attributes:
        under, x, y: between the outer edges of the wheels, before or behind them.
        side, side_x, side_y: outside of those.
    """

    under: float
    x: float
    y: float
    side: float
    side_x: float
    side_y: float


@inlined
def _plane_of(contact: Floats, sizes: SweptSizes) -> _Plane:
    return _Plane(
        0.25 * (contact[0] + contact[1] + contact[2] + contact[3]),
        (contact[0] + contact[1] - contact[2] - contact[3]) * 0.25 / sizes.half_length,
        (contact[0] - contact[1] + contact[2] - contact[3]) * 0.25 / sizes.half_width,
    )


@inlined
def _higher(highest: _Highest, over: float, x: float, y: float, sizes: SweptSizes) -> _Highest:
    """The higher of what is known and ground so far over the plane of the wheels."""
    # What is outside of the wheels counts last: much of it continues under the body.
    if abs(y) > sizes.half_width + sizes.half_tyre:
        if over > highest.side:
            return _Highest(highest.under, highest.x, highest.y, over, x, y)
    elif over > highest.under:
        return _Highest(over, x, y, highest.side, highest.side_x, highest.side_y)
    return highest


@inlined
def body_met(
    ground: Ground, pose: Pose, contact: Floats, sizes: SweptSizes, unknown_bars: bool
) -> Finding:
    """What the body meets at a pose: unknown cells first, else the ground that is highest in it.

    The body is a plate at its clearance above the plane of the wheels. Every cell that it touches
    has to be known. Every one whose middle is within its margin counts with its height, and so does
    the ground between cells at its outline, which may be that of a cell next to it. Off the map
    nothing is known.

    Args:
        ground: map. pose: of the vehicle. contact: (4,) heights of the wheels [m].
        sizes: of the vehicle.
        unknown_bars: unknown cells count, and are not passed over.
    """
    rows, columns = ground.elevation.shape
    cell, plane = 1.0 / ground.per_metre, _plane_of(contact, sizes)
    # A cell reaches farther along its diagonal.
    touched = 0.5 * cell * (abs(pose.heading_x) + abs(pose.heading_y))
    # Ground between cells is not higher than the four around it.
    wide = max(sizes.margin, DIAGONAL * cell)
    x_min, x_max = _extent(pose.x, pose.heading_x, -pose.heading_y, sizes)
    y_min, y_max = _extent(pose.y, pose.heading_y, pose.heading_x, sizes)
    u_min = (x_min - wide - ground.origin_x) * ground.per_metre
    u_max = (x_max + wide - ground.origin_x) * ground.per_metre
    v_min = (y_min - wide - ground.origin_y) * ground.per_metre
    v_max = (y_max + wide - ground.origin_y) * ground.per_metre
    highest, rises = _Highest(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False
    for i in range(int(np.ceil(v_min)), int(np.floor(v_max)) + 1):
        dy = ground.origin_y + i * cell - pose.y
        for j in range(int(np.ceil(u_min)), int(np.floor(u_max)) + 1):
            dx = ground.origin_x + j * cell - pose.x
            ahead = dx * pose.heading_x + dy * pose.heading_y
            aside = dy * pose.heading_x - dx * pose.heading_y
            away = max(max(ahead - sizes.front, -sizes.rear - ahead), abs(aside) - sizes.side)
            if away > wide:
                continue
            if i < 0 or j < 0 or i >= rows or j >= columns:
                # A cell that is only touched is no loss beside the edge of a map.
                if unknown_bars and away <= 0.0:
                    return Finding(_UNKNOWN, 0.0, ahead, aside)
                continue
            height = ground.elevation[i, j]
            if unknown_bars and away <= touched and np.isnan(height):
                return Finding(_UNKNOWN, 0.0, ahead, aside)
            over = height - (plane.level + plane.rise * ahead + plane.cross_slope * aside)
            if away > sizes.margin:
                rises |= over > sizes.clearance
                continue
            highest = _higher(highest, over, ahead, aside, sizes)
    if rises and max(highest.under, highest.side) <= sizes.clearance:
        highest = _at_outline(ground, pose, plane, sizes, highest)
    if highest.under > sizes.clearance:
        part = _part(highest.x, sizes)
        return Finding(part, highest.under, highest.x, highest.y)
    if highest.side > sizes.clearance:
        return Finding(_SIDE, highest.side, highest.side_x, highest.side_y)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@inlined
def _at_outline(
    ground: Ground, pose: Pose, plane: _Plane, sizes: SweptSizes, highest: _Highest
) -> _Highest:
    """Take in the ground along the outline of the body, bilinear between cells."""
    step = 1.0 / (_PER_CELL * ground.per_metre)
    length, width = sizes.front + sizes.rear, 2.0 * sizes.side
    along, across = int(np.ceil(length / step)), int(np.ceil(width / step))
    for n in range(2 * (along + across)):
        if n < 2 * along:
            ahead = (n // 2 + 0.5) * length / along - sizes.rear
            aside = sizes.side if n % 2 == 0 else -sizes.side
        else:
            m = n - 2 * along
            ahead = sizes.front if m % 2 == 0 else -sizes.rear
            aside = (m // 2 + 0.5) * width / across - sizes.side
        x, y = place(pose, ahead, aside)
        u, v = (x - ground.origin_x) * ground.per_metre, (y - ground.origin_y) * ground.per_metre
        over = height_at(ground.elevation, u, v)
        over -= plane.level + plane.rise * ahead + plane.cross_slope * aside
        highest = _higher(highest, over, ahead, aside, sizes)
    return highest


@inlined
def _part(ahead: float, sizes: SweptSizes) -> int:
    """Which part of the body is above a point between the wheels' outer edges."""
    axle = sizes.half_length + sizes.margin
    if ahead > axle:
        return _FRONT
    return _REAR if ahead < -axle else _UNDERSIDE
