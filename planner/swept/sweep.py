"""Poses that the screen does not clear, one by one; each candidate up to its first bar."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints, Singles
from slopewise.planner.ground.body_pose import BodyRows
from slopewise.planner.ground.terrain_profile import TerrainRows
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.swept.body_sweep import body_met
from slopewise.planner.swept.findings import Finding, Kind
from slopewise.planner.swept.looks import (
    TWIST,
    WHEEL,
    WHEELS,
    PoseRow,
    looked_closer,
    looks_at,
    slopes_at,
    wheel_looks,
)
from slopewise.planner.swept.screen import Screen
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.tube import (
    Tube,
    add_wheel_checks,
    check_edges,
    is_even_swath,
    widened,
)
from slopewise.planner.swept.tyre_profile import Facets, resting_height, standing_height
from slopewise.planner.swept.verdicts import BODY, UNSEEN
from slopewise.planner.swept.wheel_path import Ground, Pose, place, rim_at
from slopewise.planner.swept.wheel_sweep import Slopes, step_met, twisted, wheel_at

_NOTHING = int(Kind.NOTHING)
_UNKNOWN = int(Kind.UNKNOWN)


class SweptPaths(NamedTuple):
    """M candidates of up to N stations.

    Attributes:
        body: poses of the body. rows: what is known of their ground.
        tube: how far the body may be off them.
        trails: the rear wheels do not roll where the front ones did.
    """

    body: BodyRows
    rows: TerrainRows
    tube: Tube
    trails: bool


class Scratch(NamedTuple):
    """Room for one pose.

    Attributes:
        profile: (2, many) ground under a wheel, and the path of its centre.
        rim: (2 n + 1,) how far the rim of a wheel lies above its lowest point [m].
        contact: (4,) heights of the wheels [m].
        around: (4, 2) slopes of the ground around the wheels, along their way and to the left.
    """

    profile: Floats
    rim: Floats
    contact: Floats
    around: Floats


def scratch_for(sizes: SweptSizes, spacing: float) -> Scratch:
    """Room for poses at most so far apart [m]."""
    samples = math.ceil((sizes.wheel_look + spacing) / sizes.stride) + 8
    strides = int(sizes.radius / sizes.stride)
    rim = rim_at(sizes.radius, sizes.stride * np.arange(-strides, strides + 1))
    return Scratch(np.empty((2, samples)), rim, np.empty(4), np.empty((4, 2)))


class Swept(NamedTuple):
    """Bars of M candidates.

    Attributes:
        bars: code of each :class:`slopewise.planner.swept.findings.Kind`, 0 if it bars nothing.
        code: (N, M) out, 0 where nothing bars.
        found: (M, 4) out, the numbers of a :class:`slopewise.planner.swept.findings.Finding` where
        one does.
    """

    bars: Ints
    code: Ints
    found: Floats


@inlined
def pose_met(
    ground: Ground,
    facets: Facets,
    pose: Pose,
    back: float,
    looks: int,
    sizes: tuple[SweptSizes, SweptSizes],
    scratch: Scratch,
    unknown_bars: bool,
) -> Finding:
    """What bars a pose, and all poses since the one before.

    Args:
        ground: map. facets: of its cells. pose: of the vehicle.
        back: distance of the pose before [m].
        looks: bits of what is looked for; see :mod:`slopewise.planner.swept.looks`.
        sizes: of the vehicle, and of the area in which its body may be.
        scratch: room, with the slopes around the wheels.
        unknown_bars: unknown ground under the body does.
    """
    contact, size, area = scratch.contact, sizes[0], sizes[1]
    if looks & (BODY | TWIST):
        for wheel in range(4):
            ahead, aside = wheel_at(wheel, size)
            if size.fine:
                contact[wheel] = standing_height(
                    facets, pose, (ahead, aside), size, scratch.rim, unknown_bars
                )
            else:
                contact[wheel] = resting_height(ground, pose, ahead, aside)
    else:
        contact[:] = np.nan
    body = Finding(_NOTHING, 0.0, 0.0, 0.0)
    if looks & (UNSEEN | BODY):
        body = body_met(ground, pose, contact, area, unknown_bars)
        if body.kind == _UNKNOWN:
            return body
    if looks & WHEELS:
        for wheel in range(4):
            if not looks & (WHEEL << wheel):
                continue
            slopes = Slopes(scratch.around[wheel, 0], scratch.around[wheel, 1])
            met = step_met(facets, pose, wheel, back, size, slopes, scratch.profile)
            if met.kind != _NOTHING:
                return met
    if looks & TWIST:
        met = twisted(contact, size)
        if met.kind != _NOTHING:
            return met
    return body


@inlined
def _without_even_swaths(
    screen: Screen,
    pose: Pose,
    back: float,
    looks: int,
    band: float,
    sizes: SweptSizes,
    around: Floats,
) -> int:
    """Required checks without those of wheels that can meet nothing within the band [m]."""
    for wheel in range(4):
        if looks & (WHEEL << wheel):
            along, difference = around[wheel, 0], 0.0
            for side in range(-1, 2, 2):
                x, y = place(pose, 0.0, side * band)
                shifted = Pose(x, y, pose.heading_x, pose.heading_y)
                there, _ = slopes_at(shifted, wheel, screen, sizes)
                difference = max(difference, abs(there - along))
            slopes = (Slopes(along, around[wheel, 1]), difference)
            if is_even_swath(screen.facets, pose, wheel, back, band, sizes, slopes):
                looks &= ~(WHEEL << wheel)
    return looks


@inlined
def _check_lines(
    screen: Screen,
    pose: Pose,
    back: float,
    looks: int,
    band: tuple[float, float],
    sizes: SweptSizes,
    scratch: Scratch,
    heights: Floats,
) -> Finding:
    """Steps and edges on the lines of the wheels within the band, without the planned one.

    Args:
        screen: broad phase. pose: vehicle pose. back: distance of the pose before [m].
        looks: bits of required checks.
        band: how far a wheel may be off [m]; largest distance between two lines [m].
        sizes: vehicle sizes. scratch, heights: buffers.
    """
    count = int(np.ceil(band[0] / band[1]))
    stride = band[0] / max(count, 1)
    for wheel in range(4):
        if not looks & (WHEEL << wheel):
            continue
        for i in range(-count, count + 1):
            if i == 0:
                continue
            x, y = place(pose, 0.0, i * stride)
            shifted = Pose(x, y, pose.heading_x, pose.heading_y)
            along, across = slopes_at(shifted, wheel, screen, sizes)
            slopes = Slopes(along, across)
            met = step_met(screen.facets, shifted, wheel, back, sizes, slopes, scratch.profile)
            if met.kind != _NOTHING:
                return Finding(met.kind, met.height, met.ahead, met.aside + i * stride)
        along, across = slopes_at(pose, wheel, screen, sizes)
        # With its middle beyond an edge a wheel no longer stands safely on it.
        edge = band[0] + sizes.half_tyre
        beyond = int(np.ceil(edge / band[1]))
        slopes, lines = Slopes(along, across), (edge / beyond, beyond, band[0])
        met = check_edges(screen.facets, pose, wheel, lines, sizes, slopes, scratch.rim, heights)
        if met.kind != _NOTHING:
            return met
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@kernel
def sweep(
    ground: Ground,
    paths: SweptPaths,
    twist: Singles,
    screen: Screen,
    sizes: tuple[SweptSizes, SweptSizes],
    scratch: Scratch,
    out: Swept,
) -> int:
    """Bars of all candidates, up to the first of each; the first stations are where they stand.

    Args:
        ground: map. paths: M candidates.
        twist: (N, M) as of :class:`slopewise.planner.ground.terrain_profile.TerrainProfile` [m].
        screen: of the map. sizes: of the vehicle, and as wide as its tube is anywhere.
        scratch: as of :func:`scratch_for`. out: filled in.

    Returns:
        Number of poses that were looked at closely.
    """
    body, tube, size = paths.body, paths.tube, sizes[0]
    stations, candidates = body.x.shape
    looks = np.empty(candidates, np.uint8)
    bars, code, found = out.bars, out.code, out.found
    open_yet = np.full(candidates, np.uint8(255))
    has_band = tube.across.shape[0] > 0
    looked = 0
    code[:] = 0
    for k in range(1, stations):
        some = looks_at(body.x[k], body.y[k], screen, open_yet, paths.rows.known[k], looks)
        if size.fine:
            # The rear wheels roll where the front ones did, but for the first of the way.
            first = paths.rows.station[k].min() < 2.5 * size.half_length
            rear = np.uint8(255 if first or paths.trails else 0)
            row = PoseRow(body.x[k], body.y[k], body.heading_x[k], body.heading_y[k], twist[k])
            some += wheel_looks(row, screen, size, rear, open_yet, looks)
            for n in range(tube.samples):
                share, turned = 2.0 * n / (tube.samples - 1.0) - 1.0, tube.wheel_arm * tube.turned
                some += add_wheel_checks(
                    row, screen, size, share, tube.across[k], turned, rear, open_yet, looks
                )
        if some == 0:
            continue
        for j in range(candidates):
            if looks[j] == 0 or k >= paths.rows.counts[j]:
                continue
            dx, dy = body.x[k, j] - body.x[k - 1, j], body.y[k, j] - body.y[k - 1, j]
            pose = Pose(body.x[k, j], body.y[k, j], body.heading_x[k, j], body.heading_y[k, j])
            look = looked_closer(pose, int(looks[j]), screen, sizes[1], scratch.around)
            back, across = np.sqrt(dx * dx + dy * dy), tube.across[k, j] if has_band else 0.0
            band = across + tube.wheel_arm * tube.turned
            if has_band:
                look = _without_even_swaths(screen, pose, back, look, band, size, scratch.around)
            if look == 0:
                continue
            looked += 1
            area = widened(size, across + tube.arm * tube.turned, tube.turned)
            met = pose_met(
                ground, screen.facets, pose, back, look, (size, area), scratch, bars[_UNKNOWN] > 0
            )
            if has_band and bars[met.kind] == 0:
                lines = (band, tube.stride)
                met = _check_lines(screen, pose, back, look, lines, size, scratch, tube.heights)
            if bars[met.kind] > 0:
                code[k, j] = bars[met.kind]
                open_yet[j] = 0
                found[j, 0], found[j, 1] = met.kind, met.height
                found[j, 2], found[j, 3] = met.ahead, met.aside
    return looked
