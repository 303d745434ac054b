"""Polylines of stations: where points of another path lie on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.compiled_core import core
from slopewise.planner.raw_polyline import arc

_WINDOW = 1.0
"""Half length of the path searched for the vehicle [m], besides its odometry's drift."""
_DRIFT = 0.1
"""Extent of another path on which a point is searched: a metre and a share of the distance."""

AT_END = 1e-6
"""Share of a segment so close to its ends is at its end."""


class Polyline(NamedTuple):
    """Positions of stations, (N,) each, N >= 2 for a projection on it [m]."""

    x: Floats
    y: Floats

    def arc(self) -> Floats:
        """Distance from the first station in the plan view, (N,) [m]."""
        return arc(np.stack((self.x, self.y), axis=1))

    def foot(
        self, points: Polyline, low: int = 0, high: int | None = None
    ) -> tuple[Ints, Floats, Floats]:
        """Where other points are on this polyline.

        Args:
            points: (n,) positions.
            low, high: segments among which the nearest is looked for; all of them if omitted.

        Returns:
            (n,) nearest segments; shares of them, < 0 before and > 1 beyond; distances [m].
        """
        return core.feet_on_line(*self, *points, low, len(self.x) - 1 if high is None else high)


def window(expected: float) -> float:
    """How far from where it is expected a point may be found [m]."""
    return _WINDOW + _DRIFT * abs(expected)


def station_of(
    path: Polyline, station: Floats, point: tuple[float, float], expected: float
) -> float:
    """Station of a point on a path; inf at its end and beyond.

    Args:
        path: N stations; station: (N,) of them along the ground [m].
        point: on another path that runs along this one [m].
        expected: about where it is: the path may cross itself [m].
    """
    around = window(expected)
    low = int(np.searchsorted(station[1:], expected - around))
    high = int(np.searchsorted(station[:-1], expected + around, "right"))
    if low >= high:
        return np.inf if expected > station[-1] else 0.0
    segment, share, _ = path.foot(Polyline(*np.array(point)[:, None]), low, high)
    k, u = int(segment[0]), float(share[0])
    if k == len(station) - 2 and u >= 1.0 - AT_END:
        return np.inf
    return float(station[k] + min(max(u, 0.0), 1.0) * (station[k + 1] - station[k]))


def limits_along(path: Polyline, first: int, limited: Polyline, limit: Floats) -> Floats:
    """Limits of another path at the stations of one that runs along it, (N,) [m/s].

    Between two stations of the other path the lower limit counts; up to station ``first``, where
    the vehicle has been, either one allowed it to be.

    Args:
        path: N stations; first: index of the one behind the vehicle.
        limited: n stations; limit: (n,) at them [m/s].
    """
    k, u, _ = limited.foot(path)
    lower, higher = np.minimum(limit[k], limit[k + 1]), np.maximum(limit[k], limit[k + 1])
    between = np.where(np.arange(len(k)) <= first, higher, lower)
    here: Floats = np.where(u >= 1.0 - AT_END, limit[k + 1], between)
    here = np.where(u <= AT_END, limit[k], here)
    # Before the other path begins it has no say.
    return np.where((k == 0) & (u < -AT_END), np.inf, here)
