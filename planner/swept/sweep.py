"""Poses that the screen does not clear, one by one; each candidate up to its first bar."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from models.arrays import Bools, Bytes, Floats, Ints, Singles
from planner.ground.terrain_profile import TerrainRows
from planner.kernels.compiled import inlined, kernel, row_pass
from planner.swept.body_sweep import body_met
from planner.swept.findings import Finding, Kind
from planner.swept.screen import BODY, UNSEEN, WHEELS, Screen
from planner.swept.sizes import SweptSizes
from planner.swept.wheel_path import Ground, Pose, contact_height
from planner.swept.wheel_sweep import step_met, twisted, wheel_at

_NOTHING = int(Kind.NOTHING)
_UNKNOWN = int(Kind.UNKNOWN)
_TWIST, _WHEEL = 8, 16
"""More bits than the screen has: the wheels' own heights ask for a closer look; the front left
wheel may meet a step, and from there on the others."""


class SweptPaths(NamedTuple):
    """M candidates of up to N stations: positions (N, M) [m] and what is known of them."""

    x: Floats
    y: Floats
    rows: TerrainRows


def scratch_for(sizes: SweptSizes, spacing: float) -> Floats:
    """Room for the profile under a wheel, for stations at most so far apart [m]."""
    length = 2.0 * sizes.trend + 3.0 * sizes.radius + sizes.chord + spacing
    return np.empty((2, math.ceil(length / sizes.stride) + 8))


@inlined
def pose_met(
    ground: Ground, pose: Pose, back: float, looks: int, sizes: SweptSizes, around: Floats,
    scratch: Floats, contact: Floats, unknown_bars: bool,
) -> Finding:  # fmt: skip
    """What bars a pose, and all poses since the one before.

    Args:
        ground: map. pose: of the vehicle.
        back: distance of the pose before [m].
        looks: bits of what is looked for; those of the four wheels from ``_WHEEL`` on.
        sizes: of the vehicle.
        around: (4,) slopes of the ground around the wheels along the way [1].
        scratch: as of :func:`scratch_for`. contact: (4,) room for heights of the wheels.
        unknown_bars: unknown ground under the body does.
    """
    if looks & (BODY | _TWIST):
        for wheel in range(4):
            ahead, aside = wheel_at(wheel, sizes)
            contact[wheel] = contact_height(ground, pose, ahead, aside, sizes)
    else:
        contact[:] = np.nan
    body = Finding(_NOTHING, 0.0, 0.0, 0.0)
    if looks & (UNSEEN | BODY):
        body = body_met(ground, pose, contact, sizes, unknown_bars)
        if body.kind == _UNKNOWN:
            return body
    if looks & WHEELS:
        for wheel in range(4):
            if not looks & (_WHEEL << wheel):
                continue
            met = step_met(ground, pose, wheel, back, sizes, around[wheel], scratch)
            if met.kind != _NOTHING:
                return met
    if looks & _TWIST:
        met = twisted(contact, sizes)
        if met.kind != _NOTHING:
            return met
    return body


@kernel
def sweep(
    ground: Ground, paths: SweptPaths, twist: Singles, screen: Screen, sizes: SweptSizes,
    bars: Ints, scratch: Floats, code: Ints, found: Floats,
) -> int:  # fmt: skip
    """Bars of all candidates, up to the first of each; the first stations are where they stand.

    Args:
        ground: map. paths: M candidates.
        twist: (N, M) as of :class:`planner.ground.terrain_profile.TerrainProfile` [m].
        screen: of the map. sizes: of the vehicle.
        bars: code of each :class:`planner.swept.findings.Kind`, 0 if it bars nothing.
        scratch: as of :func:`scratch_for`.
        code: (N, M) out, 0 where nothing bars.
        found: (M, 4) out, the numbers of a :class:`planner.swept.findings.Finding` where one does.

    Returns:
        Number of poses that were looked at closely.
    """
    stations, candidates = paths.x.shape
    contact, around, looks = np.empty(4), np.empty(4), np.empty(candidates, np.uint8)
    open_yet = np.full(candidates, np.uint8(255))
    looked = 0
    per_block = ground.per_metre / screen.cells
    origin_x = ground.origin_x + (screen.first_column - 0.5) / ground.per_metre
    origin_y = ground.origin_y + (screen.first_row - 0.5) / ground.per_metre
    grid = (origin_x, origin_y, per_block)
    code[:] = 0
    for k in range(1, stations):
        some = _looks_at(
            paths.x[k], paths.y[k], grid, screen.bits, open_yet, paths.rows.known[k], twist[k],
            np.float32(sizes.wheel_travel), looks,
        )  # fmt: skip
        if some == 0:
            continue
        for j in range(candidates):
            if looks[j] == 0 or k >= paths.rows.counts[j]:
                continue
            dx, dy = paths.x[k, j] - paths.x[k - 1, j], paths.y[k, j] - paths.y[k - 1, j]
            pose = Pose(
                paths.x[k, j], paths.y[k, j], paths.rows.heading_x[k, j],
                paths.rows.heading_y[k, j],
            )  # fmt: skip
            # The rear wheels roll where the front ones did, but for the first of the way.
            wheels = 4 if paths.rows.station[k, j] < 2.5 * sizes.half_length else 2
            look = _looked_closer(pose, int(looks[j]), wheels, screen, grid, sizes, around)
            if look == 0:
                continue
            looked += 1
            back = np.sqrt(dx * dx + dy * dy)
            met = pose_met(
                ground, pose, back, look, sizes, around, scratch, contact, bars[_UNKNOWN] > 0
            )
            if bars[met.kind] > 0:
                code[k, j] = bars[met.kind]
                open_yet[j] = 0
                found[j, 0], found[j, 1] = met.kind, met.height
                found[j, 2], found[j, 3] = met.ahead, met.aside
    return looked


@inlined
def _block(at: float, origin: float, per_block: float, count: int) -> int:
    return min(max(int((at - origin) * per_block), 0), count - 1)


@inlined
def _looked_closer(
    pose: Pose, looks: int, wheels: int, screen: Screen, grid: tuple[float, float, float],
    sizes: SweptSizes, around: Floats,
) -> int:  # fmt: skip
    """What is left to look for: with the heading known, circles and wheels can be told apart.

    Args:
        pose: of the vehicle. looks: bits so far. wheels: how many of the wheels count.
        screen: of the map. grid: corner of its first block [m], blocks in a metre.
        sizes: of the vehicle. around: (4,) out, slopes along the way around the wheels.
    """
    rows, columns = screen.bits.shape
    origin_x, origin_y, per_block = grid
    if looks & UNSEEN:
        # Three circles along the body cover it.
        length = sizes.front + sizes.rear + 2.0 * sizes.margin
        third, clear = length / 3.0, True
        radius = np.sqrt(0.25 * third * third + (sizes.side + sizes.margin) ** 2)
        for n in range(3):
            ahead = -sizes.rear - sizes.margin + (n + 0.5) * third
            j = _block(pose.x + ahead * pose.heading_x, origin_x, per_block, columns)
            i = _block(pose.y + ahead * pose.heading_y, origin_y, per_block, rows)
            clear = clear and screen.seen[i, j] >= radius
        if clear:
            looks &= ~UNSEEN
    if looks & WHEELS:
        looks &= ~WHEELS
        for wheel in range(wheels):
            ahead, aside = wheel_at(wheel, sizes)
            x = pose.x + ahead * pose.heading_x - aside * pose.heading_y
            y = pose.y + ahead * pose.heading_y + aside * pose.heading_x
            j = _block(x, origin_x, per_block, columns)
            i = _block(y, origin_y, per_block, rows)
            if screen.steps[i, j]:
                looks |= WHEELS | (_WHEEL << wheel)
                east, north = screen.east[i, j], screen.north[i, j]
                around[wheel] = east * pose.heading_x + north * pose.heading_y
    return looks


@row_pass
def _looks_at(
    x: Floats, y: Floats, grid: tuple[float, float, float], bits: Bytes, open_yet: Bytes,
    known: Bools, twist: Singles, travel: np.float32, looks: Bytes,
) -> int:  # fmt: skip
    """What each pose of a row has to be looked at for; the number of those that have to be.

    Ground that is unknown under the wheels ends a candidate as a bar does: ``open_yet`` keeps the
    bits of those that go on.
    """
    origin_x, origin_y, per_block = grid
    flat = bits.reshape(bits.size)
    rows, columns = bits.shape
    right, top = columns - 1.0, rows - 1.0
    some = 0
    for j in range(x.shape[0]):
        u = min(max((x[j] - origin_x) * per_block, 0.0), right)
        v = min(max((y[j] - origin_y) * per_block, 0.0), top)
        block = np.uint64(np.floor(v) * columns + np.floor(u))
        hanging = np.uint8(_TWIST) if twist[j] > travel else np.uint8(0)
        goes_on = open_yet[j] & (np.uint8(255) if known[j] else np.uint8(0))
        open_yet[j] = goes_on
        look = (flat[block] | hanging) & goes_on
        looks[j] = look
        some += look
    return some
