"""Where the vehicle is on its candidates."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.compiled_core import core


@dataclass(frozen=True, slots=True)
class PathProjection:
    """The vehicle on M polylines.

    Attributes:
        segment: (M,) index of the station behind it, 0 where it is before the first one.
        x, y: (M,) nearest point of the path [m].
        along: (M,) distance from the first station in the plan view, < 0 before it [m].
        remaining: (M,) distance to the last station in the plan view [m].
        beside: (M,) distance to the path, sideways or beyond its end [m].
        turned: (M,) angle between heading and path [rad].
    """

    segment: Ints
    x: Floats
    y: Floats
    along: Floats
    remaining: Floats
    beside: Floats
    turned: Floats

    def only(self, usable: Ints) -> PathProjection:
        """The vehicle on some of the polylines, by their indices (m,)."""
        return PathProjection(*(getattr(self, f.name)[usable] for f in fields(self)))


def locate(
    x: Floats, y: Floats, count: Ints, at: tuple[float, float], heading: float
) -> PathProjection:
    """Find the vehicle on paths, where they cross themselves on the branch that goes its way.

    Args:
        x, y: (N, M) stations, finite and N >= 2 [m]; count: (M,) of each path, >= 2.
        at: position of the vehicle [m]; heading: [rad].
    """
    segment, values = np.empty(x.shape[1], np.int64), np.empty((6, x.shape[1]))
    core.locate_on_paths(x, y, count, *at, heading, segment, values)
    return PathProjection(segment, *values)
