"""What a pose has to be looked at for, as the screen of the map has it."""

from __future__ import annotations

import numpy as np

from models.arrays import Bools, Bytes, Floats, Singles
from planner.kernels.compiled import inlined, row_pass
from planner.swept.screen import Screen
from planner.swept.sizes import SweptSizes
from planner.swept.verdicts import UNSEEN
from planner.swept.wheel_path import Pose
from planner.swept.wheel_sweep import wheel_at

TWIST, WHEEL, WHEELS = 8, 16, 240
"""More bits than the screen has: the wheels' own heights ask for a closer look; the front left
wheel may meet a step, and from there on the others; any wheel may."""

_TWIST_SHOWN = 0.55
"""Share of the wheels' travel by which interpolated heights have to twist for a closer look: wheels
feel a ridge before and after they are on it, so two may where one of them stands on it."""


@row_pass
def looks_at(
    x: Floats, y: Floats, screen: Screen, open_yet: Bytes, known: Bools, twist: Singles,
    travel: np.float32, looks: Bytes,
) -> int:  # fmt: skip
    """What each pose of a row has to be looked at for; the number of those that have to be.

    Ground that is unknown under the wheels ends a candidate as a bar does: ``open_yet`` keeps the
    bits of those that go on.
    """
    origin_x, origin_y, per_block = screen.origin_x, screen.origin_y, screen.per_metre
    flat = screen.bits.reshape(screen.bits.size)
    rows, columns = screen.bits.shape
    right, top = columns - 1.0, rows - 1.0
    most = np.float32(_TWIST_SHOWN) * travel
    some = 0
    for j in range(x.shape[0]):
        u = min(max((x[j] - origin_x) * per_block, 0.0), right)
        v = min(max((y[j] - origin_y) * per_block, 0.0), top)
        block = np.uint64(np.floor(v) * columns + np.floor(u))
        hanging = np.uint8(TWIST) if twist[j] > most else np.uint8(0)
        goes_on = open_yet[j] & (np.uint8(255) if known[j] else np.uint8(0))
        open_yet[j] = goes_on
        look = (flat[block] | hanging) & goes_on
        looks[j] = look
        some += look
    return some


@row_pass
def wheel_looks(
    x: Floats, y: Floats, heading_x: Floats, heading_y: Floats, ahead: float, aside: float,
    screen: Screen, wheel: np.uint8, open_yet: Bytes, looks: Bytes,
) -> int:  # fmt: skip
    """Add a wheel's bit to the looks of a row where the wheel may meet a step; how many there are.

    Args:
        x, y, heading_x, heading_y: (M,) poses.
        ahead, aside: of the wheel, from the middle of the wheelbase [m].
        screen: of the map. wheel: its bit.
        open_yet: (M,) candidates that go on. looks: (M,) in and out.
    """
    origin_x, origin_y, per_block = screen.origin_x, screen.origin_y, screen.per_metre
    flat = screen.steps.reshape(screen.steps.size)
    rows, columns = screen.steps.shape
    right, top = columns - 1.0, rows - 1.0
    some = 0
    for j in range(x.shape[0]):
        wheel_x = x[j] + ahead * heading_x[j] - aside * heading_y[j]
        wheel_y = y[j] + ahead * heading_y[j] + aside * heading_x[j]
        u = min(max((wheel_x - origin_x) * per_block, 0.0), right)
        v = min(max((wheel_y - origin_y) * per_block, 0.0), top)
        block = np.uint64(np.floor(v) * columns + np.floor(u))
        look = (wheel if flat[block] > 0 else np.uint8(0)) & open_yet[j]
        looks[j] |= look
        some += look
    return some


@inlined
def _block(screen: Screen, x: float, y: float) -> tuple[int, int]:
    rows, columns = screen.bits.shape
    i, j = (
        int((y - screen.origin_y) * screen.per_metre),
        int((x - screen.origin_x) * screen.per_metre),
    )
    return min(max(i, 0), rows - 1), min(max(j, 0), columns - 1)


@inlined
def looked_closer(
    pose: Pose, looks: int, screen: Screen, sizes: SweptSizes, around: Floats
) -> int:  # fmt: skip
    """What is left to look for: with the heading known, circles along the body can be told apart.

    Args:
        pose: of the vehicle. looks: bits so far.
        screen: of the map. sizes: of the vehicle.
        around: (4, 2) out, slopes around the wheels, along their way and to the left.
    """
    if looks & UNSEEN:
        # Three circles along the body cover it.
        length = sizes.front + sizes.rear + 2.0 * sizes.margin
        third, clear = length / 3.0, True
        radius = np.sqrt(0.25 * third * third + (sizes.side + sizes.margin) ** 2)
        for n in range(3):
            ahead = -sizes.rear - sizes.margin + (n + 0.5) * third
            i, j = _block(screen, pose.x + ahead * pose.heading_x, pose.y + ahead * pose.heading_y)
            clear = clear and screen.seen[i, j] >= radius
        if clear:
            looks &= ~UNSEEN
    for wheel in range(4):
        if looks & (WHEEL << wheel):
            ahead, aside = wheel_at(wheel, sizes)
            x = pose.x + ahead * pose.heading_x - aside * pose.heading_y
            y = pose.y + ahead * pose.heading_y + aside * pose.heading_x
            i, j = _block(screen, x, y)
            east, north = screen.east[i, j], screen.north[i, j]
            around[wheel, 0] = east * pose.heading_x + north * pose.heading_y
            around[wheel, 1] = north * pose.heading_x - east * pose.heading_y
    return looks
