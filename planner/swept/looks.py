"""What a pose has to be looked at for, as the screen of the map has it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Bytes, Floats, Singles
from slopewise.planner.kernels.compiled import inlined, row_pass
from slopewise.planner.swept.screen import Screen
from slopewise.planner.swept.screen_reach import ROUNDING
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.verdicts import UNSEEN
from slopewise.planner.swept.wheel_path import Pose, place
from slopewise.planner.swept.wheel_sweep import wheel_at

TWIST, WHEEL, WHEELS = 8, 16, 240
"""More bits than the screen has: the wheels' own heights ask for a closer look; the front left
wheel may meet a step, and from there on the others; any wheel may."""


@row_pass
def flat_block(screen: Screen, x: float, y: float) -> np.uint64:
    """Of a point, in rows laid one behind the other; unsigned, as no index counts from the end."""
    rows, columns = screen.bits.shape
    u = min(max((x - screen.origin_x) * screen.per_metre, 0.0), columns - 1.0)
    v = min(max((y - screen.origin_y) * screen.per_metre, 0.0), rows - 1.0)
    # Of 32 bits: four at once, which this machine's instructions have for no others.
    return np.uint64(np.uint32(np.int32(v) * np.int32(columns) + np.int32(u)))


@row_pass
def looks_at(
    x: Floats, y: Floats, screen: Screen, open_yet: Bytes, known: Bools, looks: Bytes
) -> int:
    """What each pose of a row has to be looked at for; more than 0 if any has to be.

    Ground that is unknown under the wheels ends a candidate as a bar does: ``open_yet`` keeps the
    bits of those that go on.
    """
    flat = screen.bits.reshape(screen.bits.size)
    some = 0
    for j in range(x.shape[0]):
        block = flat_block(screen, x[j], y[j])
        goes_on = open_yet[j] & (np.uint8(255) if known[j] else np.uint8(0))
        open_yet[j] = goes_on
        look = flat[block] & goes_on
        looks[j] = look
        some += look
    return some


class PoseRow(NamedTuple):
    """(M,) poses of a row, and how far the ground under the wheels' middles twists [m]."""

    x: Floats
    y: Floats
    heading_x: Floats
    heading_y: Floats
    twist: Singles


@row_pass
def wheel_looks(
    row: PoseRow, screen: Screen, sizes: SweptSizes, rear: np.uint8, open_yet: Bytes, looks: Bytes
) -> int:
    """Add what the wheels of a row have to be looked at for; more than 0 if any has to be.

    A wheel stands as high as the ground under its middle, or higher by its lift; and by what a
    slope lifts each by, which it lacks at most by its lift. So wheels twist by no more than the
    ground under their middles does and all four lifts. Next to unknown ground a wheel may lack
    more: see :func:`looked_closer`.

    Args:
        row: poses. screen: of the map. sizes: of the vehicle.
        rear: 255 where the rear wheels roll on ground that the front ones have not seen, else 0.
        open_yet: (M,) candidates that go on. looks: (M,) in and out.
    """
    flat, cleared = screen.relief.reshape(screen.relief.size), screen.cleared
    lift = screen.lift.reshape(screen.lift.size)
    length, width = sizes.half_length, sizes.half_width
    x, y, heading_x, heading_y, twist = row.x, row.y, row.heading_x, row.heading_y, row.twist
    travel, none = np.float32(sizes.wheel_travel - ROUNDING), np.uint8(0)
    some = 0
    for j in range(x.shape[0]):
        along_x, along_y = length * heading_x[j], length * heading_y[j]
        left_x, left_y = -width * heading_y[j], width * heading_x[j]
        front_x, front_y = x[j] + along_x, y[j] + along_y
        rear_x, rear_y = x[j] - along_x, y[j] - along_y
        a = flat_block(screen, front_x + left_x, front_y + left_y)
        b = flat_block(screen, front_x - left_x, front_y - left_y)
        c = flat_block(screen, rear_x + left_x, rear_y + left_y)
        d = flat_block(screen, rear_x - left_x, rear_y - left_y)
        hangs = abs(twist[j]) + lift[a] + lift[b] + lift[c] + lift[d] > travel
        met = np.uint8(TWIST) if hangs else none
        met |= np.uint8(WHEEL) if flat[a] > cleared else none
        met |= np.uint8(WHEEL << 1) if flat[b] > cleared else none
        behind = np.uint8(WHEEL << 2) if flat[c] > cleared else none
        behind |= np.uint8(WHEEL << 3) if flat[d] > cleared else none
        look = (met | (behind & rear)) & open_yet[j]
        looks[j] |= look
        some += look
    return some


@inlined
def looked_closer(pose: Pose, looks: int, screen: Screen, sizes: SweptSizes, around: Floats) -> int:
    """What to look for: with the heading known, circles along body and tyres can be told apart.

    Where what a tyre touches may be unknown, so is how much of its lift a wheel lacks.

    Args:
        pose: of the vehicle. looks: bits so far.
        screen: of the map. sizes: of the vehicle.
        around: (4, 2) out, slopes around the wheels, along their way and to the left.
    """
    if looks & UNSEEN:
        # Three circles in a row cover them.
        seen = screen.seen.reshape(screen.seen.size)
        wheels = sizes.half_length + sizes.radius
        rear = max(sizes.rear, wheels) + sizes.touch
        third, clear = (max(sizes.front, wheels) + sizes.touch + rear) / 3.0, True
        side = max(sizes.side, sizes.half_width + sizes.half_tyre) + sizes.touch
        radius = np.sqrt(0.25 * third * third + side * side)
        for n in range(3):
            x, y = place(pose, (n + 0.5) * third - rear, 0.0)
            clear = clear and seen[flat_block(screen, x, y)] >= radius
        looks = looks & ~UNSEEN if clear else looks | (TWIST if sizes.fine else 0)
    for wheel in range(4):
        if looks & (WHEEL << wheel):
            around[wheel, 0], around[wheel, 1] = slopes_at(pose, wheel, screen, sizes)
    return looks


@inlined
def slopes_at(pose: Pose, wheel: int, screen: Screen, sizes: SweptSizes) -> tuple[float, float]:
    """Slopes of the ground around a wheel, along its way and to the left [1]."""
    ahead, aside = wheel_at(wheel, sizes)
    x, y = place(pose, ahead, aside)
    block = flat_block(screen, x, y)
    east = screen.east.reshape(screen.east.size)[block]
    north = screen.north.reshape(screen.north.size)[block]
    return (
        east * pose.heading_x + north * pose.heading_y,
        north * pose.heading_x - east * pose.heading_y,
    )
