"""Where the vehicle is on its candidates."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.raw_polyline import project

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
    # One layout: for each one kernels are compiled anew.
    x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
    _locate(x, y, count, at, heading, segment, values)
    return PathProjection(segment, *values)


@kernel
def _locate(
    x: Floats,
    y: Floats,
    count: Ints,
    at: tuple[float, float],
    heading: float,
    segment: Ints,
    values: Floats,
) -> None:
    """Attributes of :class:`PathProjection` in their order; ``values`` are those after segment."""
    at_x, at_y = at
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
        values[0, j], values[1, j] = x[i, j] + inside * dx, y[i, j] + inside * dy
        values[2, j], values[3, j] = along, begin - along
        values[4, j], values[5, j] = beside, min(turned, 2.0 * np.pi - turned)
