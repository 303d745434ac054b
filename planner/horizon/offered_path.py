"""The previous plan in this cycle: the vehicle found on it, and its path among the candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.path_projection import PathProjection
from slopewise.planner.horizon.polyline import Polyline
from slopewise.planner.horizon.previous_plan import BEHIND, OfferedStations, PreviousPlan
from slopewise.planner.path import PathBatch


@dataclass(frozen=True, slots=True)
class OfferedPath:
    """The path of the previous plan as it is offered in this cycle.

    Attributes:
        stations: of it, and their limits.
        far: end of the path or of the free distance, whichever is first [m].
        free: distance along the ground from the vehicle to there [m].
    """

    stations: OfferedStations
    far: tuple[float, float]
    free: float


def offered_path(
    path: PathBatch, segment: int, station: Floats, passed: float, clear: float
) -> OfferedPath:
    """What a path offers.

    Args:
        path: as it came, alone; segment: index of its station behind the vehicle.
        station: (n,) stations of it along the ground [m].
        passed: station of the vehicle on it; clear: station up to which it is free [m].
    """
    n, first = int(path.count[0]), max(segment - BEHIND, 0)
    end = min(max(clear, 0.0), float(station[n - 1]))
    far = tuple(float(np.interp(end, station[:n], a[:n, 0])) for a in (path.x, path.y))
    limit, offset = (
        None if a is None else a[first:n, 0] for a in (path.speed_limit, path.follower_offset)
    )
    line = Polyline(path.x[first:n, 0], path.y[first:n, 0])
    stations = OfferedStations(line, limit, offset)
    return OfferedPath(stations, (far[0], far[1]), end - passed)


def vehicle_on(
    previous: PreviousPlan, state: PlanarState, settings: HorizonSettings
) -> PathProjection | None:
    """The vehicle on the previous plan; None if it is not on its path, or too fast or too slow."""
    if state.flaw():
        return None
    projection = previous.locate((state.x, state.y), state.heading)
    beside, turned, along = (
        float(values[0]) for values in (projection.beside, projection.turned, projection.along)
    )
    near = beside <= settings.beside and along >= -settings.ahead
    if not (near and turned <= settings.turned):
        return None
    planned, _ = previous.speed_at(projection)
    tracks = abs(max(state.speed, 0.0) - planned) <= settings.speed_error
    return projection if tracks else None


def index_of(
    previous: PreviousPlan, projection: PathProjection, rest: PathBatch, tolerance: float
) -> int | None:
    """Index of the candidate that is the previous plan's path, None if none is.

    Args:
        previous: the plan; projection: of the vehicle on it.
        rest: candidates from the vehicle on.
        tolerance: how exactly a path of the same name is the same path [m].
    """
    if previous.plan.candidate not in rest.names:
        return None
    j = rest.names.index(previous.plan.candidate)
    n = int(rest.count[j])
    line = Polyline(rest.x[:n, j], rest.y[:n, j])
    return j if previous.agrees(projection, line, tolerance) else None
