"""Where the vehicle is on its candidates, and candidates from there on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.ground.elevation_map import ElevationMap
from planner.ground.terrain_profile import stations_along
from planner.kernels.compiled import Floats, Ints, inlined, kernel
from planner.path import PathBatch

FEWEST = 3
"""Stations that a path needs, so that it has a curvature."""

_HERE = 1e-4
"""A path that begins this close to the vehicle begins at it [m]."""

_SEARCH = 15.0
"""The vehicle is looked for on this much of a path at first: it may cross itself later [m]."""

_FOUND = 1.0
"""Where the vehicle is farther from that, or beyond its end, all of the path is searched [m]."""

_ASIDE = 1e6
"""A segment that points elsewhere counts as farther off than any that does not [m]."""

_ITS_WAY = 0.36
"""Cosine of the largest angle between the heading and a segment that goes the same way."""


@dataclass(frozen=True, slots=True)
class PathProjection:
    """The vehicle on M polylines.

    Attributes:
        segment: (M,) index of the station behind it, 0 where it is before the first one.
        x, y: (M,) nearest point of the path [m].
        along: (M,) distance from the first station in the plan view, < 0 before it [m].
        left: (M,) distance to the last station in the plan view [m].
        beside: (M,) distance to the path, sideways or beyond its end [m].
        turned: (M,) angle between heading and path [rad].
    """

    segment: Ints
    x: Floats
    y: Floats
    along: Floats
    left: Floats
    beside: Floats
    turned: Floats


def locate(
    x: Floats, y: Floats, count: Ints, at: tuple[float, float], heading: float
) -> PathProjection:
    """Find the vehicle on paths, where they cross themselves on the branch that goes its way.

    Args:
        x, y: (N, M) stations, finite and N >= 2 [m]; count: (M,) of each path, >= 2.
        at: position of the vehicle [m]; heading: [rad].
    """
    segment, place = np.empty(x.shape[1], np.int64), np.empty((6, x.shape[1]))
    _locate(x, y, count, at[0], at[1], heading, segment, place)
    return PathProjection(segment, *place)


@inlined
def project(
    x: float, y: float, x_2: float, y_2: float, at_x: float, at_y: float
) -> tuple[float, float]:
    """Where a point lies along a segment, < 0 before and > 1 behind it; squared distance to it."""
    dx, dy = x_2 - x, y_2 - y
    to_x, to_y = at_x - x, at_y - y
    share = (to_x * dx + to_y * dy) / max(dx * dx + dy * dy, 1e-18)
    inside = min(max(share, 0.0), 1.0)
    return share, (inside * dx - to_x) ** 2 + (inside * dy - to_y) ** 2


@kernel
def _locate(
    x: Floats, y: Floats, count: Ints, at_x: float, at_y: float, heading: float,
    segment: Ints, place: Floats,
) -> None:  # fmt: skip
    cosine, sine = np.cos(heading), np.sin(heading)
    for j in range(x.shape[1]):
        begin = 0.0
        nearest, least, share, along = 0, np.inf, 0.0, 0.0
        early, least_early, early_share, early_along = 0, np.inf, 0.0, 0.0
        for i in range(count[j] - 1):
            u, off = project(x[i, j], y[i, j], x[i + 1, j], y[i + 1, j], at_x, at_y)
            off = np.sqrt(off)
            dx, dy = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
            length = np.sqrt(dx * dx + dy * dy)
            if dx * cosine + dy * sine < _ITS_WAY * length:
                off += _ASIDE
            if off < least:
                nearest, least, share, along = i, off, u, begin
            if begin <= _SEARCH and off < least_early:
                early, least_early, early_share, early_along = i, off, u, begin
            begin += length
        i = nearest
        if least_early <= _FOUND and early_share <= 1.0:
            i, share, along = early, early_share, early_along
        dx, dy = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
        to_x, to_y = at_x - x[i, j], at_y - y[i, j]
        step, inside = max(np.sqrt(dx * dx + dy * dy), 1e-9), min(max(share, 0.0), 1.0)
        along += (share if i == 0 and share < 0.0 else inside) * step
        beside = np.hypot((to_x * dy - to_y * dx) / step, max(share - 1.0, 0.0) * step)
        turned = abs(np.arctan2(dy, dx) - heading) % (2.0 * np.pi)
        segment[j] = i
        place[0, j], place[1, j] = x[i, j] + inside * dx, y[i, j] + inside * dy
        place[2, j], place[3, j] = along, begin - along
        place[4, j], place[5, j] = beside, min(turned, 2.0 * np.pi - turned)


def cut(paths: PathBatch, place: PathProjection, at: tuple[float, float]) -> PathBatch:
    """Candidates from the vehicle on.

    Each begins at the vehicle's place on it, at the vehicle itself where the path begins ahead of
    it. The rest of a path keeps its stations; one shorter than two segments gets a new one.

    Args:
        paths: as they came. place: the vehicle on them, before their ends. at: its position [m].
    """
    if np.all(np.abs(place.along) <= _HERE):
        return paths
    stations, candidates = paths.x.shape
    limit = paths.speed_limit
    given = np.empty((0, 0)) if limit is None else limit
    x, y = np.empty((2, stations + 1, candidates))
    limits = np.empty((0, 0)) if limit is None else np.empty((stations + 1, candidates))
    count = np.empty(candidates, np.int64)
    _cut(
        paths.x, paths.y, given, paths.count, place.segment, place.x, place.y, place.along, *at,
        x, y, limits, count,
    )  # fmt: skip
    most = int(count.max())
    return PathBatch(
        paths.names, x[:most], y[:most], count, None if limit is None else limits[:most]
    )


@kernel
def _cut(
    x: Floats, y: Floats, limit: Floats, count: Ints, segment: Ints, place_x: Floats,
    place_y: Floats, along: Floats, at_x: float, at_y: float,
    new_x: Floats, new_y: Floats, new_limit: Floats, new_count: Ints,
) -> None:  # fmt: skip
    for j in range(x.shape[1]):
        last, ahead = count[j] - 1, along[j] < 0.0
        start_x, start_y = (at_x, at_y) if ahead else (place_x[j], place_y[j])
        kept = 0 if ahead else segment[j] + 1
        # A first step that is too short would have no direction.
        spacing = np.hypot(x[1, j] - x[0, j], y[1, j] - y[0, j])
        near = np.hypot(x[kept, j] - start_x, y[kept, j] - start_y) < 0.3 * spacing
        kept = min(kept + int(near), last)
        new_count[j] = max(count[j] - kept + 1, FEWEST)
        new_x[0, j], new_y[0, j] = start_x, start_y
        for i in range(1, new_x.shape[0]):
            k = min(kept + i - 1, last)
            new_x[i, j], new_y[i, j] = x[k, j], y[k, j]
        if kept == last:
            # Only its end is left of it.
            new_x[1, j] = 0.5 * (start_x + new_x[2, j])
            new_y[1, j] = 0.5 * (start_y + new_y[2, j])
        if limit.shape[0] > 0:
            # Between two stations either one's limit holds; of one left out, its own.
            before = limit[max(kept - 1, 0), j]
            new_limit[0, j] = before if near or ahead else max(before, limit[kept, j])
            for i in range(1, new_x.shape[0]):
                new_limit[i, j] = limit[min(kept + i - 1, last), j]


def left_behind(paths: PathBatch, place: PathProjection, elevation_map: ElevationMap) -> Floats:
    """Station of the vehicle on each candidate, along the ground; < 0 before it begins, (M,) [m].

    Args:
        paths: as they came. place: the vehicle on them.
        elevation_map: ground.
    """
    if np.all(np.abs(place.along) <= _HERE):
        return np.zeros(len(paths.names))
    lanes, i = np.arange(len(paths.names)), place.segment
    rows = min(max(int(i.max()) + 2, FEWEST), len(paths.x))
    x, y = np.ascontiguousarray(paths.x[:rows]), np.ascontiguousarray(paths.y[:rows])
    station = stations_along(elevation_map, x, y, np.minimum(paths.count, rows))
    step = np.hypot(x[i + 1, lanes] - x[i, lanes], y[i + 1, lanes] - y[i, lanes])
    gone = np.hypot(place.x - x[i, lanes], place.y - y[i, lanes])
    share = np.minimum(gone / np.maximum(step, 1e-9), 1.0)
    along = station[i, lanes] + share * (station[i + 1, lanes] - station[i, lanes])
    left: Floats = np.where(place.along < 0.0, place.along, along)
    return left


def only(paths: PathBatch, usable: Ints) -> PathBatch:
    """Some of the candidates."""
    limit = (
        None if paths.speed_limit is None else np.ascontiguousarray(paths.speed_limit[:, usable])
    )
    names = tuple(paths.names[j] for j in usable)
    x, y = (np.ascontiguousarray(a[:, usable]) for a in (paths.x, paths.y))
    return PathBatch(names, x, y, paths.count[usable], limit)


def only_places(place: PathProjection, usable: Ints) -> PathProjection:
    """The vehicle on some of the candidates."""
    return PathProjection(
        *(getattr(place, name)[usable] for name in PathProjection.__dataclass_fields__)
    )
