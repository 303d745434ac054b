"""The band around the planned line in which body and wheels may be, with the errors of tracking.

The body becomes wider by the band of its outermost corner; wheels are checked on lines to
either side of the planned one, no farther from each other than a cell or half a tyre.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bytes, Floats
from slopewise.models.input_errors import InputErrors
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.kernels.compiled import inlined, row_pass
from slopewise.planner.swept.findings import Finding, Kind
from slopewise.planner.swept.looks import WHEEL, PoseRow, flat_block
from slopewise.planner.swept.screen import Screen
from slopewise.planner.swept.screen_reach import cells_of
from slopewise.planner.swept.sizes import DIAGONAL, SweptSizes
from slopewise.planner.swept.tyre_profile import Facets, standing_height
from slopewise.planner.swept.wheel_path import Pose, place
from slopewise.planner.swept.wheel_sweep import SLOPE_OPEN, STEEPEST, Slopes, wheel_at

_NOTHING, _RISE, _DROP = int(Kind.NOTHING), int(Kind.RISE), int(Kind.DROP)

_CELL_SHARE = 0.5
"""Bands of one map are rounded up to this share of a cell [1], so that its broad phase serves all
candidates of a cycle and of the next ones."""


_SAME_LINE = 1e-9
"""Rounding of distances between lines [m]."""


class Tube(NamedTuple):
    """Band of M candidates of up to N stations.

    Attributes:
        across: (N, M) by how far the reference point may be off the line [m]; (0, 0): by nothing.
        turned: sine of the heading error.
        arm: farthest end of the body from the reference point [m]. wheel_arm: likewise of a wheel.
        stride: largest distance between two lines of a wheel [m].
        samples: places abreast at which the blocks under it are checked [1].
        heights: (2 n + 1,) buffer for the heights of a wheel on these lines.
    """

    across: Floats
    turned: float
    arm: float
    wheel_arm: float
    stride: float
    samples: int
    heights: Floats


NO_TUBE = Tube(np.empty((0, 0)), 0.0, 0.0, 0.0, 1.0, 0, np.empty(1))
"""Of a vehicle that follows its plan exactly."""


def tube_of(
    errors: InputErrors,
    profile: TerrainProfile,
    body_offset: float,
    sizes: SweptSizes,
    resolution: float,
) -> tuple[Tube, SweptSizes]:
    """The band, and sizes for the broad phase that cover its widest place.

    Args:
        errors: at the quantile of the plan.
        profile: M candidates.
        body_offset: distance from the reference point ahead to mid-wheelbase [m].
        sizes: vehicle sizes. resolution: edge of a cell [m].
    """
    if not errors.has_band:
        return NO_TUBE, sizes
    across = errors.cross_track + errors.cross_track_per_curvature * np.abs(profile.curvature)
    turned = math.sin(errors.heading)
    arm = max(sizes.front, sizes.rear) + body_offset
    wheel_arm = sizes.half_length + body_offset
    step = _CELL_SHARE * resolution
    widest = step * math.ceil(float(across.max()) / step)
    stride = max(resolution, sizes.half_tyre)
    edge = cells_of(sizes, resolution) * resolution
    wheel_band = widest + wheel_arm * turned
    tube = Tube(
        across,
        turned,
        arm,
        wheel_arm,
        stride,
        math.ceil(2.0 * wheel_band / edge) + 1,
        np.empty(2 * math.ceil((wheel_band + sizes.half_tyre) / stride) + 1),
    )
    # Half a block to either side covers what lies between two samples.
    wide = widened(sizes, widest + arm * turned, turned)
    return tube, wide._replace(half_tyre=sizes.half_tyre + 0.5 * edge)


@inlined
def widened(sizes: SweptSizes, band: float, turned: float) -> SweptSizes:
    """Sizes of the area in which the body may be: wider by a band [m], longer as corners turn."""
    longer = sizes.side * turned
    return SweptSizes(
        sizes.half_length,
        sizes.half_width,
        sizes.front + longer,
        sizes.rear + longer,
        sizes.side + band,
        sizes.margin,
        sizes.touch,
        sizes.clearance,
        sizes.wheel_travel,
        sizes.radius,
        sizes.half_tyre,
        sizes.max_step,
        sizes.stride,
        sizes.chord,
        sizes.steepest,
        sizes.cleared,
        sizes.trend,
        sizes.tyres,
        sizes.fine,
    )


@row_pass
def add_wheel_checks(
    row: PoseRow,
    screen: Screen,
    sizes: SweptSizes,
    share: float,
    across: Floats,
    turned: float,
    rear: np.uint8,
    open_yet: Bytes,
    required: Bytes,
) -> int:
    """Add the exact checks of wheels at this share of the band to the left.

    ``rear`` is 255 where the rear wheels roll on ground that the front ones have not seen, else 0.
    """
    flat, cleared = screen.relief.reshape(screen.relief.size), screen.cleared
    length, width, none = sizes.half_length, sizes.half_width, np.uint8(0)
    x, y, heading_x, heading_y = row.x, row.y, row.heading_x, row.heading_y
    some = 0
    for j in range(x.shape[0]):
        shift = share * (across[j] + turned)
        left, right = shift + width, shift - width
        along_x, along_y = length * heading_x[j], length * heading_y[j]
        front_x, front_y = x[j] + along_x, y[j] + along_y
        rear_x, rear_y = x[j] - along_x, y[j] - along_y
        left_x, left_y = -left * heading_y[j], left * heading_x[j]
        right_x, right_y = -right * heading_y[j], right * heading_x[j]
        a = flat[flat_block(screen, front_x + left_x, front_y + left_y)] > cleared
        b = flat[flat_block(screen, front_x + right_x, front_y + right_y)] > cleared
        c = flat[flat_block(screen, rear_x + left_x, rear_y + left_y)] > cleared
        d = flat[flat_block(screen, rear_x + right_x, rear_y + right_y)] > cleared
        met = np.uint8(WHEEL) if a else none
        met |= np.uint8(WHEEL << 1) if b else none
        behind = np.uint8(WHEEL << 2) if c else none
        behind |= np.uint8(WHEEL << 3) if d else none
        checks = (met | (behind & rear)) & open_yet[j]
        required[j] |= checks
        some += checks
    return some


@inlined
def is_even_swath(
    ground: Facets,
    pose: Pose,
    wheel: int,
    back: float,
    band: float,
    sizes: SweptSizes,
    slopes: tuple[Slopes, float],
) -> bool:
    """Return True if no line of a wheel within the band can meet a step or an edge.

    All cells that any line touches lie so close to one plane that no climb and no change across
    exceeds what is cleared of a single line.

    Args:
        ground: map around the pose. pose: vehicle pose. wheel: as of :func:`wheel_at`.
        back: distance of the pose before [m]. band: how far the wheel may be off [m].
        sizes: vehicle sizes.
        slopes: slopes of the ground around the wheel; by how much the first differs on other lines.
    """
    plane, difference = slopes
    ahead, lateral = wheel_at(wheel, sizes)
    cell, reach = 1.0 / ground.per_metre, sizes.radius + sizes.stride
    begin, end = ahead - back - reach, ahead + sizes.chord + reach
    margin = 0.5 * DIAGONAL * cell
    length, width = 0.5 * (end - begin) + margin, band + 2.0 * sizes.half_tyre + margin
    x, y = place(pose, 0.5 * (begin + end), lateral)
    u, v = (x - ground.origin_x) * ground.per_metre, (y - ground.origin_y) * ground.per_metre
    along_x, along_y = pose.heading_x, pose.heading_y
    wide = (length * abs(along_x) + width * abs(along_y)) * ground.per_metre
    high = (length * abs(along_y) + width * abs(along_x)) * ground.per_metre
    east = (plane.along * along_x - plane.across * along_y) * cell
    north = (plane.along * along_y + plane.across * along_x) * cell
    rows, columns = ground.cells.shape[0], ground.cells.shape[1]
    first_row, end_row = int(np.ceil(v - high)), int(np.floor(v + high)) + 1
    first_column, end_column = int(np.ceil(u - wide)), int(np.floor(u + wide)) + 1
    if first_row < 0 or first_column < 0 or end_row > rows or end_column > columns:
        return False
    highest, lowest = -np.inf, np.inf
    for i in range(first_row, end_row):
        for j in range(first_column, end_column):
            du, dv = j - u, i - v
            if abs(du * along_x + dv * along_y) > length * ground.per_metre:
                continue
            if abs(dv * along_x - du * along_y) > width * ground.per_metre:
                continue
            height = ground.cells[i, j, 0] - east * du - north * dv
            if height != height:
                return False
            tilt = abs(ground.cells[i, j, 1] - east) + abs(ground.cells[i, j, 2] - north)
            highest, lowest = max(highest, height + 0.5 * tilt), min(lowest, height - 0.5 * tilt)
    lift = sizes.radius * (np.sqrt(1.0 + plane.along * plane.along) - 1.0)
    lift += 2.0 * SLOPE_OPEN * sizes.half_tyre + difference * (end - begin)
    return bool(highest - lowest + lift <= sizes.cleared)


@inlined
def check_edges(
    ground: Facets,
    pose: Pose,
    wheel: int,
    band: tuple[float, int, float],
    sizes: SweptSizes,
    slopes: Slopes,
    rim: Floats,
    heights: Floats,
) -> Finding:
    """An edge along the way that a wheel would cross sideways within the band.

    What a wheel stands on may rise or fall from line to line as the slope around does; within the
    chord that distinguishes a step from a ramp, what remains is at most a step.

    Args:
        ground: map around the pose. pose: vehicle pose. wheel: as of :func:`wheel_at`.
        band: distance between two lines [m], lines to either side, and how far the wheel may be
            off [m]: on lines beyond, only ground that falls counts.
        sizes: vehicle sizes. slopes: slopes of the ground around the wheel.
        rim: as of :func:`standing_height`. heights: (≥ 2 n + 1,) buffer.
    """
    stride, count, within = band
    ahead, lateral = wheel_at(wheel, sizes)
    lines = 2 * count + 1
    for i in range(lines):
        place = (ahead, lateral + (i - count) * stride)
        heights[i] = standing_height(ground, pose, place, sizes, rim, True)
    window = int(np.ceil(sizes.chord / stride))
    slope = min(abs(slopes.across), STEEPEST) if slopes.across == slopes.across else 0.0
    for i in range(lines):
        for k in range(i + 1, min(i + window + 1, lines)):
            change = heights[k] - heights[i]
            explained = (slope + SLOPE_OPEN) * (k - i) * stride
            if abs(change) - explained > sizes.max_step:
                outer = k if k + i >= 2 * count else i
                rises = change > 0.0 if outer == k else change < 0.0
                if rises and abs(outer - count) * stride > within + _SAME_LINE:
                    continue
                kind = _RISE if rises else _DROP
                return Finding(kind, abs(change), ahead, lateral + (outer - count) * stride)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)
