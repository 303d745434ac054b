"""Candidates from the vehicle on, and how far it is along them."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.planner.followed_line import MIN_STATIONS
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.horizon.path_projection import PathProjection
from slopewise.planner.path import PathBatch

_HERE = 1e-4
"""A path that begins this close to the vehicle begins at it [m]."""

_TOO_NEAR = 0.3
"""Share of the spacing within which a first step would be too short to have a direction [1]."""


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
    lanes, last = np.arange(len(paths.names)), paths.count - 1
    ahead = projection.along < 0.0
    start = np.where(ahead, np.array(at)[:, None], (projection.x, projection.y))
    first = np.where(ahead, 0, projection.segment + 1)
    spacing = np.hypot(paths.x[1] - paths.x[0], paths.y[1] - paths.y[0])
    step = paths.rows[:2, first, lanes] - start
    near = np.hypot(*step) < _TOO_NEAR * spacing
    first = np.minimum(first + near, last)
    count = np.maximum(last - first + 2, MIN_STATIONS)
    rows = np.minimum(first + np.arange(int(count.max()) - 1)[:, None], last)
    rest = np.empty((4, len(rows) + 1, len(lanes)))
    rest[:2, 0] = start
    rest[:, 1:] = paths.rows[:, rows, lanes]
    # Between two stations either one's limit and distance of who follows what was given holds; of
    # an omitted one, and ahead of a path, its own.
    behind, there = paths.rows[2:, np.maximum(first - 1, 0), lanes], rest[2:, 1]
    holds = near | ahead
    rest[2, 0] = np.where(holds, behind[0], np.maximum(behind[0], there[0]))
    rest[3, 0] = np.where(holds, behind[1], np.minimum(behind[1], there[1]))
    ends = first == last  # only its end is left of it
    rest[:2, 1, ends] = 0.5 * (rest[:2, 0, ends] + rest[:2, 2, ends])
    return PathBatch(paths.names, rest, count)


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
