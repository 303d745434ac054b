"""What a pose has to be looked at for, as the screen of the map has it."""

from __future__ import annotations

import numpy as np

from models.arrays import Bools, Bytes, Floats, Singles
from planner.kernels.compiled import inlined, row_pass
from planner.swept.screen import Screen
from planner.swept.sizes import SweptSizes
from planner.swept.verdicts import UNSEEN
from planner.swept.wheel_path import Pose, place
from planner.swept.wheel_sweep import wheel_at

TWIST, WHEEL, WHEELS = 8, 16, 240
"""More bits than the screen has: the wheels' own heights ask for a closer look; the front left
wheel may meet a step, and from there on the others; any wheel may."""

_TWIST_SHOWN = 0.55
"""Share of the wheels' travel by which interpolated heights have to twist for a closer look: wheels
feel a ridge before and after they are on it, so two may where one of them stands on it."""


@row_pass
def _flat_block(screen: Screen, x: float, y: float) -> np.uint64:
    """Of a point, in rows laid one behind the other; unsigned, as no index counts from the end."""
    rows, columns = screen.bits.shape
    u = min(max((x - screen.origin_x) * screen.per_metre, 0.0), columns - 1.0)
    v = min(max((y - screen.origin_y) * screen.per_metre, 0.0), rows - 1.0)
    # Of 32 bits: four at once, which this machine's instructions have for no others.
    return np.uint64(np.uint32(np.int32(v) * np.int32(columns) + np.int32(u)))


@row_pass
def looks_at(
    x: Floats, y: Floats, screen: Screen, open_yet: Bytes, known: Bools, twist: Singles,
    travel: np.float32, looks: Bytes,
) -> int:  # fmt: skip
    """What each pose of a row has to be looked at for; the number of those that have to be.

    Ground that is unknown under the wheels ends a candidate as a bar does: ``open_yet`` keeps the
    bits of those that go on.
    """
    flat = screen.bits.reshape(screen.bits.size)
    most = np.float32(_TWIST_SHOWN) * travel
    some = 0
    for j in range(x.shape[0]):
        block = _flat_block(screen, x[j], y[j])
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
    screen: Screen, left: np.uint8, open_yet: Bytes, looks: Bytes,
) -> int:  # fmt: skip
    """Add the bits of an axle's wheels to the looks of a row where they may meet a step.

    Args:
        x, y, heading_x, heading_y: (M,) poses.
        ahead, aside: of the left wheel, from the middle of the wheelbase [m].
        screen: of the map. left: bit of the left wheel; that of the right one is the next.
        open_yet: (M,) candidates that go on. looks: (M,) in and out.

    Returns:
        0 if there is none.
    """
    flat = screen.steps.reshape(screen.steps.size)
    some = 0
    for j in range(x.shape[0]):
        axle_x, axle_y = x[j] + ahead * heading_x[j], y[j] + ahead * heading_y[j]
        east, north = aside * heading_y[j], aside * heading_x[j]
        at_left = flat[_flat_block(screen, axle_x - east, axle_y + north)]
        at_right = flat[_flat_block(screen, axle_x + east, axle_y - north)]
        look = (at_left * left + at_right * (left + left)) & open_yet[j]
        looks[j] |= look
        some += look
    return some


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
        seen = screen.seen.reshape(screen.seen.size)
        length = sizes.front + sizes.rear + 2.0 * sizes.margin
        third, clear = length / 3.0, True
        radius = np.sqrt(0.25 * third * third + (sizes.side + sizes.margin) ** 2)
        for n in range(3):
            ahead = -sizes.rear - sizes.margin + (n + 0.5) * third
            x, y = place(pose, ahead, 0.0)
            clear = clear and seen[_flat_block(screen, x, y)] >= radius
        if clear:
            looks &= ~UNSEEN
    for wheel in range(4):
        if looks & (WHEEL << wheel):
            ahead, aside = wheel_at(wheel, sizes)
            x, y = place(pose, ahead, aside)
            block = _flat_block(screen, x, y)
            east = screen.east.reshape(screen.east.size)[block]
            north = screen.north.reshape(screen.north.size)[block]
            around[wheel, 0] = east * pose.heading_x + north * pose.heading_y
            around[wheel, 1] = north * pose.heading_x - east * pose.heading_y
    return looks
