"""How far a planned line lies from the polyline that was given for it, either way round.

Places are compared with those that they correspond to in order, not with the nearest of all: a path
may cross itself or come back along itself (planner/core/path/path_deviation.hpp).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.planner.compiled_core import core

_EXPECTED_SHARE = 0.25
"""Distances above this share of their limit are more than smoothing needs, and get a sentence."""


_ON_LINE = 0.01
"""Who follows a line this close to the planned one is on it [m]: maps are not drawn more exactly,
and odometry is not read so."""


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


def follower_offset(
    deviation: Floats, points: Floats, matched: Floats, wheelbase: float, overhang: float
) -> Floats | None:
    """Largest lateral distance between line and a vehicle on the given polyline, None without any.

    Its axles are on the polyline, and within the deviations around the station; the ends of its
    body are farther away where the chord from axle to axle is turned from the line.

    Args:
        deviation: (N,) largest distance of both around each station [m].
        points: (N, 2) stations [m], evenly apart. matched: (N, 2) places of the polyline [m].
        wheelbase: distance of the axles [m].
        overhang: largest distance by which the body extends beyond an axle [m].

    Returns:
        (N,) distances [m].
    """
    if deviation.max() <= _ON_LINE:
        return None
    step = max(float(np.hypot(*(points[1] - points[0]))), 1e-9)
    reach = int(np.ceil(0.5 * wheelbase / step))
    around = np.pad(deviation, reach, mode="edge")
    axles: Floats = np.lib.stride_tricks.sliding_window_view(around, 2 * reach + 1).max(axis=1)
    at, last = np.arange(len(points)), len(points) - 1
    ahead = np.gradient(points, axis=0)
    chord = matched[np.minimum(at + reach, last)] - matched[np.maximum(at - reach, 0)]
    cross = ahead[:, 0] * chord[:, 1] - ahead[:, 1] * chord[:, 0]
    turned = np.abs(cross) / np.maximum(np.hypot(*ahead.T) * np.hypot(*chord.T), 1e-9)
    return np.where(axles > _ON_LINE, axles + overhang * turned, 0.0)


def too_far_error(given: Floats, even: Floats, max_deviation: float) -> ParameterError:
    """Error of stations (N, 2) that lie farther from the points that were given, (n, 2) [m]."""
    distance = core.deviation(given, even)
    (x, y), deviation = even[np.argmax(distance)], float(distance.max())
    nearest = int(np.argmin(np.hypot(given[:, 0] - x, given[:, 1] - y)))
    return ParameterError(
        f"points[{nearest}]",
        f"points that can be followed within {max_deviation:.3g} m (limits.max_path_deviation): at "
        f"({x:.2f}, {y:.2f}) the closest line that can be driven is {deviation:.2f} m off",
    )


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
    distance = core.deviation(given, np.stack((x, y), axis=1), part)
    return _largest_of(distance, x, y, station, limit)


def _largest_of(
    distance: Floats, x: Floats, y: Floats, station: Floats, limit: float
) -> PathDeviation:
    k = int(distance.argmax())
    largest, at, at_x, at_y = (float(values[k]) for values in (distance, station, x, y))
    return PathDeviation(largest, at, at_x, at_y, limit, distance)
