"""Candidates from the vehicle on, and how far it is along them."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.planner.compiled_core import core
from slopewise.planner.followed_line import MIN_STATIONS
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.horizon.path_projection import PathProjection
from slopewise.planner.path import PathBatch

_HERE = 1e-4
"""A path that begins this close to the vehicle begins at it [m]."""


def cut(paths: PathBatch, projection: PathProjection, at: tuple[float, float]) -> PathBatch:
    """Candidates from the vehicle on.

    Each begins at the vehicle's projection, at the vehicle itself where the path begins ahead of
    it. The rest of a path keeps its stations; one shorter than two segments gets a new one.

    Args:
        paths: as they came. projection: the vehicle on them, before their ends. at: its position
            [m].
    """
    if np.all(np.abs(projection.along) <= _HERE):
        return paths
    ahead = projection.along < 0.0
    start = np.where(ahead, at[0], projection.x), np.where(ahead, at[1], projection.y)
    behind = np.where(ahead, -1, projection.segment)
    rest, first, near, count = core.cut_paths(
        paths.x, paths.y, paths.count, behind, *start, MIN_STATIONS
    )
    longest = int(count.max())
    limit, closeness = (
        _cut_limits(row, paths.count, first, near | ahead, longest)
        for row in (paths.rows[2], -paths.rows[3])
    )
    return PathBatch(paths.names, np.stack((*rest[:, :longest], limit, -closeness)), count)


def _cut_limits(limit: Floats, count: Ints, first: Ints, holds: Bools, rows: int) -> Floats:
    """Limits at the new stations, (rows, M) [m/s].

    Between two stations either one's limit holds; of an omitted one, and ahead of a path, its own.

    Args:
        limit: (N, M) of the paths [m/s]; count: (M,) their stations.
        first: (M,) first station that stays; holds: (M,) the limit before it holds up to it.
    """
    lanes = np.arange(len(first))
    before = limit[np.maximum(first - 1, 0), lanes]
    start = np.where(holds, before, np.maximum(before, limit[first, lanes]))
    further = np.minimum(first + np.arange(rows - 1)[:, None], count - 1)
    return np.concatenate((start[None], limit[further, lanes]))


def passed_stations(
    paths: PathBatch, projection: PathProjection, elevation_map: ElevationMap, vehicle: Vehicle
) -> Floats:
    """Station of the vehicle on each candidate along the ground, < 0 before it begins, (M,) [m]."""
    if np.all(np.abs(projection.along) <= _HERE):
        return np.zeros(len(paths.names))
    lanes, i = np.arange(len(paths.names)), projection.segment
    rows = min(max(int(i.max()) + 2, MIN_STATIONS), len(paths.x))
    x, y = np.ascontiguousarray(paths.x[:rows]), np.ascontiguousarray(paths.y[:rows])
    count = np.minimum(paths.count, rows)
    station = terrain_profile(elevation_map, x, y, count, vehicle).station
    step = np.hypot(x[i + 1, lanes] - x[i, lanes], y[i + 1, lanes] - y[i, lanes])
    gone = np.hypot(projection.x - x[i, lanes], projection.y - y[i, lanes])
    share = np.minimum(gone / np.maximum(step, 1e-9), 1.0)
    along = station[i, lanes] + share * (station[i + 1, lanes] - station[i, lanes])
    passed: Floats = np.where(projection.along < 0.0, projection.along, along)
    return passed
