"""The body of one pose against the ground under and beside it, and ground that nobody saw."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.swept.findings import Finding, Kind
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.wheel_path import Ground, Pose

_NOTHING, _UNKNOWN, _UNDERSIDE = int(Kind.NOTHING), int(Kind.UNKNOWN), int(Kind.UNDERSIDE)
_FRONT, _REAR, _SIDE = int(Kind.FRONT), int(Kind.REAR), int(Kind.SIDE)


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


@inlined
def body_met(
    ground: Ground, pose: Pose, contact: Floats, sizes: SweptSizes, unknown_bars: bool
) -> Finding:
    """What the body meets at a pose: unknown cells first, else the cell that is highest in it.

    The body is a plate at its clearance above the plane of the wheels. Every cell that it touches
    counts with its height. Off the map nothing is known.

    Args:
        ground: map. pose: of the vehicle. contact: (4,) heights of the wheels [m].
        sizes: of the vehicle.
        unknown_bars: unknown cells count, and are not passed over.
    """
    x_min, x_max = _extent(pose.x, pose.heading_x, -pose.heading_y, sizes)
    y_min, y_max = _extent(pose.y, pose.heading_y, pose.heading_x, sizes)
    rows, columns = ground.elevation.shape
    u_min = (x_min - sizes.margin - ground.origin_x) * ground.per_metre
    u_max = (x_max + sizes.margin - ground.origin_x) * ground.per_metre
    v_min = (y_min - sizes.margin - ground.origin_y) * ground.per_metre
    v_max = (y_max + sizes.margin - ground.origin_y) * ground.per_metre
    level = 0.25 * (contact[0] + contact[1] + contact[2] + contact[3])
    rise = (contact[0] + contact[1] - contact[2] - contact[3]) * 0.25 / sizes.half_length
    lean = (contact[0] - contact[1] + contact[2] - contact[3]) * 0.25 / sizes.half_width
    front, rear = sizes.front + sizes.margin, sizes.rear + sizes.margin
    side, cell = sizes.side + sizes.margin, 1.0 / ground.per_metre
    # Beside the wheels counts last: much that stands there goes on under the body.
    tyres = sizes.half_width + sizes.half_tyre
    highest, at_ahead, at_aside = 0.0, 0.0, 0.0
    beside, beside_ahead, beside_aside = 0.0, 0.0, 0.0
    for i in range(int(np.ceil(v_min)), int(np.floor(v_max)) + 1):
        dy = ground.origin_y + i * cell - pose.y
        for j in range(int(np.ceil(u_min)), int(np.floor(u_max)) + 1):
            dx = ground.origin_x + j * cell - pose.x
            ahead = dx * pose.heading_x + dy * pose.heading_y
            aside = dy * pose.heading_x - dx * pose.heading_y
            if ahead > front or ahead < -rear or abs(aside) > side:
                continue
            if i < 0 or j < 0 or i >= rows or j >= columns:
                # A cell that is only touched is no loss beside the edge of a map.
                if unknown_bars and _within(ahead, aside, sizes):
                    return Finding(_UNKNOWN, 0.0, ahead, aside)
                continue
            height = ground.elevation[i, j]
            if unknown_bars and np.isnan(height):
                return Finding(_UNKNOWN, 0.0, ahead, aside)
            over = height - (level + rise * ahead + lean * aside)
            if abs(aside) > tyres:
                if over > beside:
                    beside, beside_ahead, beside_aside = over, ahead, aside
            elif over > highest:
                highest, at_ahead, at_aside = over, ahead, aside
    if highest > sizes.clearance:
        return Finding(_part(at_ahead, sizes), highest, at_ahead, at_aside)
    if beside > sizes.clearance:
        return Finding(_SIDE, beside, beside_ahead, beside_aside)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@inlined
def _within(ahead: float, aside: float, sizes: SweptSizes) -> bool:
    inside = -sizes.rear <= ahead and ahead <= sizes.front
    return inside and abs(aside) <= sizes.side


@inlined
def _part(ahead: float, sizes: SweptSizes) -> int:
    """Which part of the body is above a point between the wheels' outer edges."""
    axle = sizes.half_length + sizes.margin
    if ahead > axle:
        return _FRONT
    return _REAR if ahead < -axle else _UNDERSIDE
