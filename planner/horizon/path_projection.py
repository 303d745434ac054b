"""Where the vehicle is on its candidates."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.compiled_core import core
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.path import PathBatch
from slopewise.planner.swept.convergence import Departure


@dataclass(frozen=True, slots=True)
class PathProjection:
    """The vehicle on M polylines.

    Attributes:
        segment: (M,) index of the station behind it, 0 where it is before the first one.
        x, y: (M,) nearest point of the path [m].
        along: (M,) distance from the first station in the plan view, < 0 before it [m].
        remaining: (M,) distance to the last station in the plan view [m].
        lateral_offset: (M,) distance to the path, sideways or beyond its end [m].
        turned: (M,) angle between heading and path [rad].
    """

    segment: Ints
    x: Floats
    y: Floats
    along: Floats
    remaining: Floats
    lateral_offset: Floats
    turned: Floats

    def only(self, usable: Ints) -> PathProjection:
        """The vehicle on some of the polylines, by their indices (m,)."""
        return PathProjection(*(getattr(self, f.name)[usable] for f in fields(self)))


def locate(
    x: Floats, y: Floats, count: Ints, at: tuple[float, float], heading: float
) -> PathProjection:
    """Find the vehicle on paths, where they cross themselves on the branch of its direction.

    Args:
        x, y: (N, M) stations, finite and N >= 2 [m]; count: (M,) of each path, >= 2.
        at: position of the vehicle [m]; heading: [rad].
    """
    segment, values = core.locate_on_paths(x, y, count, *at, heading)
    return PathProjection(segment, *values)


def locate_on(x: Floats, y: Floats, at: tuple[float, float], heading: float) -> PathProjection:
    """The same on one path of (N,) stations [m]."""
    return locate(x[:, None], y[:, None], np.array([len(x)]), at, heading)


def departure_of(
    paths: PathBatch, state: PlanarState, speed: float = 0.0, places: Floats | None = None
) -> Departure:
    """The actual pose of the vehicle against M paths on which it was found before.

    Args:
        paths: the candidates. state: the vehicle's.
        speed: highest one that it may reach until a new command takes effect [m/s].
        places: (k, 2) where earlier commands may lead it until a new one takes effect [m].
    """
    projection, offset = _offset(paths, (state.x, state.y), state.heading)
    speed, later = max(state.speed, speed), None
    if places is not None and len(places) > 0:
        later = np.stack([_offset(paths, (x, y), state.heading)[1] for x, y in places.tolist()])
        later = np.stack([later.min(axis=0), later.max(axis=0)])
    k, along = projection.segment, projection.along
    return Departure(k, along, offset, state.heading, speed, state.age, later)


def _offset(
    paths: PathBatch, at: tuple[float, float], heading: float
) -> tuple[PathProjection, Floats]:
    """A place on M paths, and its signed distance from them, to the left positive [m]."""
    projection = locate(paths.x, paths.y, paths.count, at, heading)
    k, lanes = projection.segment, np.arange(len(projection.segment))
    x, y = paths.x[k, lanes], paths.y[k, lanes]
    dx, dy = paths.x[k + 1, lanes] - x, paths.y[k + 1, lanes] - y
    cross = dx * (at[1] - y) - dy * (at[0] - x)
    return projection, cross / np.maximum(np.hypot(dx, dy), 1e-9)
