"""How far a planned line lies from the polyline that was given for it, either way round.

Places are compared with those that they correspond to in order, not with the nearest of all: a path
may cross itself or come back along itself (planner/core/path/path_deviation.hpp).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core

_EXPECTED_SHARE = 0.25
"""Distances above this share of their limit are more than smoothing needs, and get a sentence."""


class GivenPolyline(NamedTuple):
    """A given polyline, and how far the stations laid along it lie from it.

    Attributes:
        points: (n, 2) [m]. deviation: largest distance between both lines [m].
        ends: reason why the path ends before what was given does, empty where it does not.
    """

    points: Floats
    deviation: float
    ends: str = ""


@dataclass(frozen=True, slots=True)
class PathDeviation:
    """How far a plan's line lies from the polyline that was given, in the plan view.

    Attributes:
        largest: distance [m], at ``station`` along the ground [m] and at ``x, y`` of the plan [m],
            which are those of the nearest of its rows.
        limit: that it keeps [m].
        distance: (N,) largest one around each station [m]; 0 before the given path begins and
            beyond its end.
    """

    largest: float
    station: float
    x: float
    y: float
    limit: float
    distance: Floats

    @property
    def sentence(self) -> str:
        """A sentence about a larger distance than expected, empty otherwise."""
        if self.largest <= _EXPECTED_SHARE * self.limit:
            return ""
        place = f"at {self.station:.2f} m, x {self.x:.2f} m, y {self.y:.2f} m"
        return (
            f"planned up to {self.largest:.2f} m away from the given path, {place}; "
            f"the limit is {self.limit:.3g} m"
        )

    def from_row(self, first: int, x: Floats, y: Floats, station: Floats) -> PathDeviation:
        """Of the same line from a row on; positions and stations of its rows, (N − first,) [m]."""
        return _largest_of(self.distance[first:], x, y, station, self.limit)


def path_deviation(
    given: Floats,
    x: Floats,
    y: Floats,
    station: Floats,
    limit: float,
    part: tuple[float, float] | None = None,
) -> PathDeviation:
    """How far a planned line lies from the polyline that was given.

    Args:
        given: (n, 2) points, n >= 2 [m].
        x, y, station: (N,) of the planned line, N >= 2 [m].
        limit: that it has to keep [m].
        part: where the planned line begins on the stations of the whole path, < 0 before them, and
            the length of these [m]; then the common part of both lines is compared.
    """
    distance = np.zeros(len(x))
    line = np.empty((len(x), 2))
    line[:, 0], line[:, 1] = x, y
    if part is None:
        core.deviation_along(given, line, distance)
    else:
        core.deviation_of_part(given, line, *part, distance)
    return _largest_of(distance, x, y, station, limit)


def _largest_of(
    distance: Floats, x: Floats, y: Floats, station: Floats, limit: float
) -> PathDeviation:
    k = int(distance.argmax())
    largest, at, at_x, at_y = (float(values[k]) for values in (distance, station, x, y))
    return PathDeviation(largest, at, at_x, at_y, limit, distance)
