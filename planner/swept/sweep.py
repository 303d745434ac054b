"""Poses that the screen does not clear, one by one; each candidate up to its first bar."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints, Singles
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
    wheel_looks,
)
from slopewise.planner.swept.screen import Screen
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.tyre_profile import Facets, resting_height, standing_height
from slopewise.planner.swept.verdicts import BODY, UNSEEN
from slopewise.planner.swept.wheel_path import Ground, Pose, rim_at
from slopewise.planner.swept.wheel_sweep import Slopes, step_met, twisted, wheel_at

_NOTHING = int(Kind.NOTHING)
_UNKNOWN = int(Kind.UNKNOWN)


class SweptPaths(NamedTuple):
    """M candidates of up to N stations: positions (N, M) [m] and what is known of them."""

    x: Floats
    y: Floats
    rows: TerrainRows


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
    sizes: SweptSizes,
    scratch: Scratch,
    unknown_bars: bool,
) -> Finding:
    """What bars a pose, and all poses since the one before.

    Args:
        ground: map. facets: of its cells. pose: of the vehicle.
        back: distance of the pose before [m].
        looks: bits of what is looked for; see :mod:`slopewise.planner.swept.looks`.
        sizes: of the vehicle.
        scratch: room, with the slopes around the wheels.
        unknown_bars: unknown ground under the body does.
    """
    contact = scratch.contact
    if looks & (BODY | TWIST):
        for wheel in range(4):
            ahead, aside = wheel_at(wheel, sizes)
            if sizes.fine:
                contact[wheel] = standing_height(
                    facets, pose, (ahead, aside), sizes, scratch.rim, unknown_bars
                )
            else:
                contact[wheel] = resting_height(ground, pose, ahead, aside)
    else:
        contact[:] = np.nan
    body = Finding(_NOTHING, 0.0, 0.0, 0.0)
    if looks & (UNSEEN | BODY):
        body = body_met(ground, pose, contact, sizes, unknown_bars)
        if body.kind == _UNKNOWN:
            return body
    if looks & WHEELS:
        for wheel in range(4):
            if not looks & (WHEEL << wheel):
                continue
            slopes = Slopes(scratch.around[wheel, 0], scratch.around[wheel, 1])
            met = step_met(facets, pose, wheel, back, sizes, slopes, scratch.profile)
            if met.kind != _NOTHING:
                return met
    if looks & TWIST:
        met = twisted(contact, sizes)
        if met.kind != _NOTHING:
            return met
    return body


@kernel
def sweep(
    ground: Ground,
    paths: SweptPaths,
    twist: Singles,
    screen: Screen,
    sizes: SweptSizes,
    scratch: Scratch,
    out: Swept,
) -> int:
    """Bars of all candidates, up to the first of each; the first stations are where they stand.

    Args:
        ground: map. paths: M candidates.
        twist: (N, M) as of :class:`slopewise.planner.ground.terrain_profile.TerrainProfile` [m].
        screen: of the map. sizes: of the vehicle.
        scratch: as of :func:`scratch_for`. out: filled in.

    Returns:
        Number of poses that were looked at closely.
    """
    stations, candidates = paths.x.shape
    looks = np.empty(candidates, np.uint8)
    bars, code, found = out.bars, out.code, out.found
    open_yet = np.full(candidates, np.uint8(255))
    looked = 0
    code[:] = 0
    for k in range(1, stations):
        some = looks_at(paths.x[k], paths.y[k], screen, open_yet, paths.rows.known[k], looks)
        if sizes.fine:
            # The rear wheels roll where the front ones did, but for the first of the way.
            rear = np.uint8(255 if paths.rows.station[k].min() < 2.5 * sizes.half_length else 0)
            row = PoseRow(
                paths.x[k], paths.y[k], paths.rows.heading_x[k], paths.rows.heading_y[k], twist[k]
            )
            some += wheel_looks(row, screen, sizes, rear, open_yet, looks)
        if some == 0:
            continue
        for j in range(candidates):
            if looks[j] == 0 or k >= paths.rows.counts[j]:
                continue
            dx, dy = paths.x[k, j] - paths.x[k - 1, j], paths.y[k, j] - paths.y[k - 1, j]
            pose = Pose(
                paths.x[k, j],
                paths.y[k, j],
                paths.rows.heading_x[k, j],
                paths.rows.heading_y[k, j],
            )
            look = looked_closer(pose, int(looks[j]), screen, sizes, scratch.around)
            if look == 0:
                continue
            looked += 1
            back = np.sqrt(dx * dx + dy * dy)
            met = pose_met(
                ground, screen.facets, pose, back, look, sizes, scratch, bars[_UNKNOWN] > 0
            )
            if bars[met.kind] > 0:
                code[k, j] = bars[met.kind]
                open_yet[j] = 0
                found[j, 0], found[j, 1] = met.kind, met.height
                found[j, 2], found[j, 3] = met.ahead, met.aside
    return looked
