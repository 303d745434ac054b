"""The ground under a tyre along its way, and where it stands, from facets of cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.arrays import Floats, Singles
from planner.ground.elevation_map import height_at
from planner.kernels.compiled import inlined
from planner.swept.sizes import SweptSizes
from planner.swept.wheel_path import NO_GROUND, Ground, Pose, drop_of_rim, place


class Facets(NamedTuple):
    """Part of a map for compiled code.

    Attributes:
        cells: (rows, columns, 4) as of :class:`planner.swept.blocks.Blocks`.
        origin_x, origin_y: centre of cell [0, 0] [m]. per_metre: cells in a metre.
        level: height of the map that theirs are above [m].
    """

    cells: Singles
    origin_x: float
    origin_y: float
    per_metre: float
    level: float


class TyreLine(NamedTuple):
    """Where samples lie.

    Attributes:
        begin: of sample 0, ahead of the pose [m].
        aside: of the middle of the tyre, to the left of the pose [m].
        lean: slope to the left that the wheel leans with [1].
    """

    begin: float
    aside: float
    lean: float


@inlined
def tyre_profile(
    ground: Facets, pose: Pose, line: TyreLine, first: int, end: int, sizes: SweptSizes,
    profile: Floats,
) -> None:  # fmt: skip
    """Highest known ground across a tyre along its way, above one level [m].

    What the wheel leans with is taken off: on a cross slope a tyre meets what lies askew with its
    lower edge, too.

    Args:
        ground: of the map around the pose. pose: of the vehicle. line: of the samples.
        first, end: samples, ``sizes.stride`` apart. sizes: of the vehicle.
        profile: filled in from first to end, :data:`NO_GROUND` where nothing is known.
    """
    begin, aside, lean = line.begin, line.aside, line.lean
    cells = ground.cells
    rows, columns, _ = cells.shape
    along_u = pose.heading_x * ground.per_metre
    along_v = pose.heading_y * ground.per_metre
    # Half a cell on: the whole part is the cell, and no coordinate inside is below 0.
    middle_u = (pose.x - ground.origin_x) * ground.per_metre + begin * along_u + 0.5
    middle_v = (pose.y - ground.origin_y) * ground.per_metre + begin * along_v + 0.5
    step_u, step_v = sizes.stride * along_u, sizes.stride * along_v
    for n in range(first, end):
        profile[n] = NO_GROUND
    for tyre in range(sizes.tyres):
        off = sizes.half_tyre * (2.0 * tyre / (sizes.tyres - 1) - 1.0)
        across, leaned = aside + off, lean * off
        start_u, start_v = middle_u - across * along_v, middle_v + across * along_u
        for n in range(first, end):
            u, v = start_u + n * step_u, start_v + n * step_v
            if not (u >= 0.0 and v >= 0.0 and u < columns and v < rows):
                continue
            j, i = int(u), int(v)
            row, column = np.uint64(i), np.uint64(j)
            height = cells[row, column, 0] + cells[row, column, 1] * (u - 0.5 - j)
            height += cells[row, column, 2] * (v - 0.5 - i) - leaned
            # A branch would be guessed wrong half of the time. Unknown cells count for none.
            profile[n] = max(profile[n], height if height == height else NO_GROUND)


@inlined
def standing_height(
    ground: Facets, pose: Pose, ahead: float, aside: float, sizes: SweptSizes, profile: Floats
) -> float:
    """Height of the lowest point of a wheel that stands on its rim [m], NaN where all is unknown.

    Args:
        ground: of the map around the pose. pose: of the vehicle.
        ahead, aside: of the wheel, from the pose [m]. sizes: of the vehicle.
        profile: room for samples.
    """
    strides = int(sizes.radius / sizes.stride)
    line = TyreLine(ahead - strides * sizes.stride, aside, 0.0)
    tyre_profile(ground, pose, line, 0, 2 * strides + 1, sizes, profile)
    highest = NO_GROUND
    for n in range(2 * strides + 1):
        height = profile[n] - drop_of_rim(sizes.radius, (n - strides) * sizes.stride)
        highest = max(highest, height)
    return float(highest + ground.level if highest > 0.5 * NO_GROUND else np.nan)


@inlined
def resting_height(ground: Ground, pose: Pose, ahead: float, aside: float) -> float:
    """The same on a map coarser than the wheel, which stands on its bilinear surface [m]."""
    x, y = place(pose, ahead, aside)
    u = (x - ground.origin_x) * ground.per_metre
    v = (y - ground.origin_y) * ground.per_metre
    return float(height_at(ground.elevation, u, v))
