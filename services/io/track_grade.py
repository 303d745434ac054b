"""Grade of the ground under a logged track, from an elevation map."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault
from slopewise.services.io.map_file import read_map_around
from slopewise.services.io.no_data import NoData

_log = logging.getLogger("slopewise")
_SPACING = 0.3  # between positions whose ground is looked up [m]; nearer ones are mostly noise
_MIN_MARKS = 3  # positions with a heading between neighbours [1]


def grade_by_map(log: DriveLog, map_file: Path, vehicle: Vehicle, nodata: NoData = None) -> Floats:
    """(samples,) grade under the wheels [rad], NaN off the known map.

    The log has x, y in map coordinates, and the vehicle drives forward.
    """
    if not {"x", "y"} <= log.columns.keys():
        raise fault(log.sources[0], "column x", "expected x and y to place the log on the map")
    x, y = log.columns["x"], log.columns["y"]
    placed = np.isfinite(x) & np.isfinite(y)
    if not placed.any():
        raise fault(log.sources[0], "column x", "expected positions, got none")
    points = np.stack((x[placed], y[placed]), axis=1)
    elevation_map = read_map_around(map_file, points, vehicle, nodata=nodata)
    for assumption in elevation_map.assumed:
        _log.warning("%s: %s", map_file, assumption)
    grade = np.full(len(x), np.nan)
    for run in log.runs:
        here = np.flatnonzero(placed[run]) + run.start
        if len(here):
            grade[here] = _along(elevation_map, x[here], y[here], vehicle)
    if not np.isfinite(grade).any():
        raise fault(map_file, "extent", "expected known ground under the log, got none")
    return grade


def _along(elevation_map: ElevationMap, x: Floats, y: Floats, vehicle: Vehicle) -> Floats:
    from slopewise.planner.ground.averaged_map import averaged_map  # compiled
    from slopewise.planner.ground.terrain_profile import terrain_profile

    marks = _marks(x, y)
    if len(marks) < _MIN_MARKS:
        return np.full(len(x), np.nan)
    profile = terrain_profile(
        averaged_map(elevation_map, vehicle.wheel_radius),
        np.ascontiguousarray(x[marks, None]),
        np.ascontiguousarray(y[marks, None]),
        np.array([len(marks)]),
        vehicle,
    )
    grade = np.where(profile.known[:, 0], profile.grade[:, 0], np.nan)
    # Distance from mark to mark, and along each leg for the samples between.
    leg = np.searchsorted(marks, np.arange(len(x)), side="right") - 1
    nearest = marks[leg]
    ahead = marks[np.minimum(leg + 1, len(marks) - 1)]
    length = np.hypot(x[ahead] - x[nearest], y[ahead] - y[nearest])
    passed = np.hypot(x - x[nearest], y - y[nearest])
    share = np.divide(passed, length, out=np.zeros_like(length), where=length > 0.0)
    position = leg + np.clip(share, 0.0, 1.0)
    return np.asarray(np.interp(position, np.arange(len(marks)), grade))


def _marks(x: Floats, y: Floats) -> NDArray[np.int64]:
    """Samples at least a spacing apart, the first one included."""
    marks = [0]
    for i in range(1, len(x)):
        if abs(x[i] - x[marks[-1]]) + abs(y[i] - y[marks[-1]]) < _SPACING:
            continue
        if np.hypot(x[i] - x[marks[-1]], y[i] - y[marks[-1]]) >= _SPACING:
            marks.append(i)
    return np.array(marks)
