"""Where the vehicle is on its candidates, and candidates from there on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.compiled import Floats, Ints
from planner.elevation_map import ElevationMap
from planner.path import PathBatch
from planner.terrain_profile import terrain_profile

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
class Place:
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


def locate(x: Floats, y: Floats, count: Ints, at: tuple[float, float], heading: float) -> Place:
    """Find the vehicle on paths, where they cross themselves on the branch that goes its way.

    Args:
        x, y: (N, M) stations, finite and N >= 2 [m]; count: (M,) of each path, >= 2.
        at: position of the vehicle [m]; heading: [rad].
    """
    lanes = np.arange(x.shape[1])
    dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
    length = np.hypot(dx, dy)
    begins = np.vstack((np.zeros((1, x.shape[1])), np.cumsum(length, axis=0)))
    squared = np.maximum(length * length, 1e-18)
    share = ((at[0] - x[:-1]) * dx + (at[1] - y[:-1]) * dy) / squared
    inside = np.clip(share, 0.0, 1.0)
    off = np.hypot(x[:-1] + inside * dx - at[0], y[:-1] + inside * dy - at[1])
    ahead = dx * np.cos(heading) + dy * np.sin(heading)
    off += np.where(ahead < _ITS_WAY * length, _ASIDE, 0.0)
    off = np.where(np.arange(len(off))[:, None] < count - 1, off, np.inf)
    early = np.where(begins[:-1] <= _SEARCH, off, np.inf)
    segment: Ints = np.argmin(early, axis=0).astype(np.int64)
    found = (early[segment, lanes] <= _FOUND) & (share[segment, lanes] <= 1.0)
    segment = np.where(found, segment, np.argmin(off, axis=0))
    u, own = share[segment, lanes], inside[segment, lanes]
    tangent_x, tangent_y = dx[segment, lanes], dy[segment, lanes]
    step = np.maximum(length[segment, lanes], 1e-9)
    first = (segment == 0) & (u < 0.0)
    along = begins[segment, lanes] + np.where(first, u, own) * step
    offset = (at[0] - x[segment, lanes]) * tangent_y - (at[1] - y[segment, lanes]) * tangent_x
    beyond = np.maximum(u - 1.0, 0.0) * step
    direction = np.arctan2(tangent_y, tangent_x) - heading
    return Place(
        segment,
        x[segment, lanes] + own * tangent_x,
        y[segment, lanes] + own * tangent_y,
        along,
        begins[count - 1, lanes] - along,
        np.hypot(offset / step, beyond),
        np.abs(np.angle(np.exp(1j * direction))),
    )


def cut(paths: PathBatch, place: Place, at: tuple[float, float]) -> PathBatch:
    """Candidates from the vehicle on.

    Each begins at the vehicle's place on it, at the vehicle itself where the path begins ahead of
    it. The rest of a path keeps its stations; one shorter than two segments gets a new one.

    Args:
        paths: as they came. place: the vehicle on them, before their ends. at: its position [m].
    """
    if np.all(np.abs(place.along) <= _HERE):
        return paths
    lanes, last = np.arange(len(paths.names)), paths.count - 1
    ahead = place.along < 0.0
    start_x, start_y = np.where(ahead, at[0], place.x), np.where(ahead, at[1], place.y)
    kept = np.where(ahead, 0, place.segment + 1)
    # A first step that is too short would have no direction.
    spacing = np.hypot(paths.x[1] - paths.x[0], paths.y[1] - paths.y[0])
    near = np.hypot(paths.x[kept, lanes] - start_x, paths.y[kept, lanes] - start_y) < 0.3 * spacing
    kept = np.minimum(kept + near, last)
    count = np.maximum(paths.count - kept + 1, FEWEST)
    rows = np.minimum(kept + np.arange(int(count.max()) - 1)[:, None], last)
    limit = paths.speed_limit
    if limit is not None:
        # Between two stations either one's limit holds; of one left out, its own.
        before = limit[np.maximum(kept - 1, 0), lanes]
        before = np.where(near | ahead, before, np.maximum(before, limit[kept, lanes]))
        limit = np.vstack((before, np.take_along_axis(limit, rows, axis=0)))
    x = np.vstack((start_x, np.take_along_axis(paths.x, rows, axis=0)))
    y = np.vstack((start_y, np.take_along_axis(paths.y, rows, axis=0)))
    for j in np.flatnonzero(kept == last):
        # Only its end is left of it.
        x[1, j], y[1, j] = 0.5 * (x[0, j] + x[2, j]), 0.5 * (y[0, j] + y[2, j])
    return PathBatch(paths.names, x, y, count, limit)


def left_behind(
    paths: PathBatch, place: Place, elevation_map: ElevationMap, footprint: tuple[float, float]
) -> Floats:
    """Station of the vehicle on each candidate, along the ground; < 0 before it begins, (M,) [m].

    Args:
        paths: as they came. place: the vehicle on them.
        elevation_map: ground; footprint: wheelbase and track width [m].
    """
    if np.all(np.abs(place.along) <= _HERE):
        return np.zeros(len(paths.names))
    lanes, i = np.arange(len(paths.names)), place.segment
    rows = min(max(int(i.max()) + 2, FEWEST), len(paths.x))
    x, y = np.ascontiguousarray(paths.x[:rows]), np.ascontiguousarray(paths.y[:rows])
    station = terrain_profile(
        elevation_map, x, y, np.minimum(paths.count, rows), *footprint
    ).station
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


def only_places(place: Place, usable: Ints) -> Place:
    """The vehicle on some of the candidates."""
    return Place(*(getattr(place, name)[usable] for name in Place.__dataclass_fields__))
