"""The ground under a tyre along its way, and where it stands, from facets of cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Singles
from slopewise.planner.ground.bilinear import height_at
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.wheel_path import NO_GROUND, Ground, Pose, place


class Facets(NamedTuple):
    """Part of a map for compiled code.

    Attributes:
        cells: (rows, columns, 4) as of :class:`slopewise.planner.swept.blocks.Blocks`; the
        outermost are
            unknown.
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
    ground: Facets,
    pose: Pose,
    line: TyreLine,
    first: int,
    end: int,
    sizes: SweptSizes,
    profile: Floats,
) -> None:
    """Highest known ground across a tyre along its way, above one level [m].

    What the wheel leans with is taken off: on a cross slope a tyre meets what lies askew with its
    lower edge, too.

    Args:
        ground: of the map around the pose. pose: of the vehicle. line: of the samples.
        first, end: samples, ``sizes.stride`` apart. sizes: of the vehicle.
        profile: filled in from first to end, :data:`NO_GROUND` where nothing is known.
    """
    begin, aside, lean = line.begin, line.aside, line.lean
    for n in range(first, end):
        profile[n] = NO_GROUND
    for tyre in range(sizes.tyres):
        off = _across(tyre, sizes)
        run, leaned = _run(ground, pose, begin, aside + off, sizes.stride), lean * off
        for n in range(first, end):
            height = _facet_height(ground, run, n) - leaned
            # A branch would be guessed wrong half of the time. Unknown cells count for none.
            profile[n] = max(profile[n], height if height == height else NO_GROUND)


@inlined
def _across(tyre: int, sizes: SweptSizes) -> float:
    """How far a line of samples lies to the left of the middle of the tyre [m]."""
    return float(sizes.half_tyre * (2.0 * tyre / (sizes.tyres - 1) - 1.0))


class _Run(NamedTuple):
    """Samples along a straight line: cell of the first one, its place in it, cells a sample."""

    row: np.int32
    column: np.int32
    u: np.float32
    v: np.float32
    step_u: np.float32
    step_v: np.float32


@inlined
def _run(ground: Facets, pose: Pose, begin: float, aside: float, stride: float) -> _Run:
    """Samples from a point ahead and to the left of a pose on, so far apart [m]."""
    x, y = place(pose, begin, aside)
    u, v = (x - ground.origin_x) * ground.per_metre, (y - ground.origin_y) * ground.per_metre
    column, row = np.rint(u), np.rint(v)
    return _Run(
        np.int32(row),
        np.int32(column),
        np.float32(u - column),
        np.float32(v - row),
        np.float32(stride * pose.heading_x * ground.per_metre),
        np.float32(stride * pose.heading_y * ground.per_metre),
    )


@inlined
def _facet_height(ground: Facets, run: _Run, n: int) -> float:
    """Height of the facet under sample n [m], NaN where it is unknown; off the map all is."""
    cells, sample = ground.cells, np.float32(np.int32(n))
    u, v = run.u + sample * run.step_u, run.v + sample * run.step_v
    j, i = np.rint(u), np.rint(v)
    column = min(max(np.int32(j) + run.column, np.int32(0)), np.int32(cells.shape[1] - 1))
    row = min(max(np.int32(i) + run.row, np.int32(0)), np.int32(cells.shape[0] - 1))
    r, c = np.uint64(row), np.uint64(column)
    return float(cells[r, c, 0] + cells[r, c, 1] * (u - j) + cells[r, c, 2] * (v - i))


@inlined
def standing_height(
    ground: Facets,
    pose: Pose,
    wheel: tuple[float, float],
    sizes: SweptSizes,
    rim: Floats,
    unknown_falls: bool,
) -> float:
    """Height of the lowest point of a wheel that stands on its rim [m], NaN where all is unknown.

    Args:
        ground: of the map around the pose. pose: of the vehicle.
        wheel: where it is, ahead and to the left of the pose [m]. sizes: of the vehicle.
        rim: (2 n + 1,) how far it lies above its lowest point, ``sizes.stride`` apart [m].
        unknown_falls: into unknown ground a wheel sinks as far as what is known around lets it;
            otherwise its height on that is unknown, NaN.
    """
    ahead, aside = wheel
    begin = ahead - (rim.shape[0] // 2) * sizes.stride
    highest, seen = NO_GROUND, True
    for tyre in range(sizes.tyres):
        off = _across(tyre, sizes)
        run = _run(ground, pose, begin, aside + off, sizes.stride)
        for n in range(rim.shape[0]):
            height = _facet_height(ground, run, n) - rim[n]
            known = height == height
            highest = max(highest, height if known else NO_GROUND)
            seen &= known
    is_supported = (highest > 0.5 * NO_GROUND) & (seen | unknown_falls)
    return float(highest + ground.level if is_supported else np.nan)


@inlined
def resting_height(ground: Ground, pose: Pose, ahead: float, aside: float) -> float:
    """The same on a map coarser than the wheel, which stands on its bilinear surface [m]."""
    x, y = place(pose, ahead, aside)
    u = (x - ground.origin_x) * ground.per_metre
    v = (y - ground.origin_y) * ground.per_metre
    return float(height_at(ground.elevation, u, v))
