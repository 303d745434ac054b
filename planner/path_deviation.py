"""How far a planned line lies from the polyline that was given for it, either way round.

Places are compared with those that they correspond to in order, not with the nearest of all: a path
may cross itself or come back along itself. No place of either line is farther from the other than
the reported distance and `_EXACT`; where the order of places is lost, the distance is larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.raw_polyline import arc, project

_REACH = 1.0
"""So far along the planned line from where it is expected a place is looked for: less than a turn
to a neighbouring lane takes, more than rounding a corner shifts places [m]."""

_DRIFT = 0.1
"""The same as a share of the distance to it, where only part of a path is planned [1]."""

_EXACT = 5e-4
"""Shortest step between two places that are examined on one segment [m]."""


class GivenPolyline(NamedTuple):
    """A given polyline, and how far the stations laid along it lie from it.

    Attributes:
        points: (n, 2) [m]. deviation: largest distance between both lines [m].
    """

    points: Floats
    deviation: float


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
        deviation_along(given, line, distance)
    else:
        _deviation_of_part(given, line, *part, distance)
    return _largest_of(distance, x, y, station, limit)


def _largest_of(
    distance: Floats, x: Floats, y: Floats, station: Floats, limit: float
) -> PathDeviation:
    k = int(distance.argmax())
    largest, at, at_x, at_y = (float(values[k]) for values in (distance, station, x, y))
    return PathDeviation(largest, at, at_x, at_y, limit, distance)


@kernel
def deviation_along(given: Floats, line: Floats, distance: Floats) -> None:
    """Lay the largest distance between both lines around each station.

    Args:
        given: (n, 2), line: (N, 2) points, 2 at least, each from its beginning to its end [m].
        distance: (N,) zeros, to be filled [m].
    """
    along, n = arc(line), given.shape[0]
    window = np.empty((line.shape[0], 2), np.int64)
    feet, away, back = np.empty(n), np.empty(n), np.empty(line.shape[0])
    _feet_on_line(given, line, along, feet, away)
    _feet_on_given(given, line, along, feet, window, back, distance)
    for i in range(n):
        k = int(feet[i] + 0.5)
        distance[k] = max(distance[k], away[i])
    _between_given(given, line, along, feet, distance)
    _between_stations(given, line, window, back, distance)


@kernel
def _feet_on_line(given: Floats, line: Floats, along: Floats, feet: Floats, away: Floats) -> None:
    """For each given point the place on the line, as number of a station with a share, and [m]."""
    at, low, high, last = 0.0, 0, 1, line.shape[0] - 1
    for i in range(given.shape[0]):
        ahead = at + _REACH
        if i > 0:
            ahead += math.hypot(given[i, 0] - given[i - 1, 0], given[i, 1] - given[i - 1, 1])
        while low > 0 and along[low] > at - _REACH:
            low -= 1
        while low < last - 1 and along[low + 1] < at - _REACH:
            low += 1
        high = max(high, low + 1)
        while high > low + 1 and along[high - 1] > ahead:
            high -= 1
        while high < last and along[high] <= ahead:
            high += 1
        k, share, away[i] = _nearest(line, low, high, given[i, 0], given[i, 1])
        feet[i] = k + share
        at = along[k] + share * (along[k + 1] - along[k])


@kernel
def _feet_on_given(
    given: Floats,
    line: Floats,
    along: Floats,
    feet: Floats,
    window: Ints,
    back: Floats,
    away: Floats,
) -> None:
    """For each station the given segments around it, the place on them, and its distance [m]."""
    n, last = given.shape[0], line.shape[0] - 1
    latest, earliest = feet.copy(), feet.copy()
    for i in range(1, n):
        latest[i] = max(latest[i], latest[i - 1])
        earliest[n - 1 - i] = min(earliest[n - 1 - i], earliest[n - i])
    low, high, first, beyond = 0, 1, 0, 0
    for k in range(line.shape[0]):
        while along[k] - along[first] > _REACH:
            first += 1
        while beyond < last and along[beyond] - along[k] <= _REACH:
            beyond += 1
        while low < n - 2 and latest[low + 1] < first:
            low += 1
        while high < n - 1 and earliest[high] <= beyond:
            high += 1
        window[k, 0], window[k, 1] = low, max(high, low + 1)
        i, share, away[k] = _nearest(given, low, window[k, 1], line[k, 0], line[k, 1])
        back[k] = i + share


@kernel
def _between_given(
    given: Floats, line: Floats, along: Floats, feet: Floats, distance: Floats
) -> None:
    """Look between given points, where the stations between their feet leave more possible."""
    largest, last = distance.max(), line.shape[0] - 1
    for i in range(given.shape[0] - 1):
        low, high = min(feet[i], feet[i + 1]), max(feet[i], feet[i + 1])
        if _farthest(given, i, line, math.ceil(low), int(high) + 1) <= largest + _EXACT:
            continue
        first, beyond = int(low), min(int(high) + 1, last)
        while first > 0 and along[int(low)] - along[first] < _REACH:
            first -= 1
        while beyond < last and along[beyond] - along[int(high)] < _REACH:
            beyond += 1
        dx, dy = given[i + 1, 0] - given[i, 0], given[i + 1, 1] - given[i, 1]
        at, length = 0.0, math.hypot(dx, dy)
        while at < length:
            x, y = given[i, 0] + at / length * dx, given[i, 1] + at / length * dy
            k, share, away = _nearest(line, first, beyond, x, y)
            k = int(k + share + 0.5)
            distance[k] = max(distance[k], away)
            largest = max(largest, away)
            # A distance grows no faster than its place moves: before that none can be larger.
            at += max(largest - away, _EXACT)


@kernel
def _between_stations(
    given: Floats, line: Floats, window: Ints, back: Floats, distance: Floats
) -> None:
    """The same between stations."""
    largest = distance.max()
    for k in range(line.shape[0] - 1):
        low, high = min(back[k], back[k + 1]), max(back[k], back[k + 1])
        if _farthest(line, k, given, math.ceil(low), int(high) + 1) <= largest + _EXACT:
            continue
        first = min(window[k, 0], window[k + 1, 0])
        beyond = max(window[k, 1], window[k + 1, 1])
        dx, dy = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
        at, length = 0.0, math.hypot(dx, dy)
        while at < length:
            x, y = line[k, 0] + at / length * dx, line[k, 1] + at / length * dy
            _, _, away = _nearest(given, first, beyond, x, y)
            j = k + int(at / length + 0.5)
            distance[j] = max(distance[j], away)
            largest = max(largest, away)
            at += max(largest - away, _EXACT)


@inlined
def _nearest(line: Floats, low: int, high: int, x: float, y: float) -> tuple[int, float, float]:
    """Nearest of the segments ``low`` to ``high`` − 1, share of it, and distance to it."""
    segment, share, nearest = low, 0.0, np.inf
    for k in range(low, high):
        u, away = project(line[k, 0], line[k, 1], line[k + 1, 0], line[k + 1, 1], x, y)
        if away < nearest:
            segment, share, nearest = k, min(max(u, 0.0), 1.0), away
    return segment, share, math.sqrt(nearest)


@inlined
def _farthest(line: Floats, k: int, points: Floats, low: int, high: int) -> float:
    """Largest distance of points ``low`` to ``high`` − 1 from segment ``k``; 0 without any.

    Matched in order with these points, no place of the segment is farther from their line.
    """
    farthest = 0.0
    for i in range(low, high):
        _, away = project(
            line[k, 0], line[k, 1], line[k + 1, 0], line[k + 1, 1], points[i, 0], points[i, 1]
        )
        farthest = max(farthest, away)
    return math.sqrt(farthest)


@kernel
def _deviation_of_part(
    given: Floats, line: Floats, passed: float, length: float, distance: Floats
) -> None:
    """As :func:`deviation_along`, between the later beginning and the earlier end of both lines.

    Args:
        given, line, distance: as there; the line is planned along part of a path.
        passed: where the line begins on the whole path, < 0 before it [m].
        length: whole path [m].
    """
    at = arc(given)
    # Noise makes the given polyline longer than the stations along it.
    stretch = at[-1] / max(length, 1e-9)
    same, n, rows = 0, given.shape[0], line.shape[0]
    while (
        same < min(n, rows) - 1
        and given[n - 1 - same, 0] == line[rows - 1 - same, 0]
        and given[n - 1 - same, 1] == line[rows - 1 - same, 1]
    ):
        same += 1
    # Where both are one from a vertex on, as the rest of a path mostly is, nothing is apart.
    n, rows = n - max(same - 1, 0), rows - max(same - 1, 0)
    given, line, at = given[:n], line[:rows], at[:n]
    along = arc(line)
    begin, first = 0.0, 0.0
    if passed > 0.0:
        begin = _place(given, at, passed * stretch, line[0, 0], line[0, 1])
    else:
        first = _place(line, along, -passed, given[0, 0], given[0, 1])
    expected = _arc_at(at, begin) + (along[-1] - _arc_at(along, first)) * stretch
    end, last = _place(given, at, expected, line[-1, 0], line[-1, 1]), float(rows - 1)
    if end >= n - 1 - 1e-6:
        left = (at[-1] - _arc_at(at, begin)) / stretch
        last = _place(line, along, _arc_at(along, first) + left, given[-1, 0], given[-1, 1])
    part = _part(line, first, max(last, first))
    part_distance = np.zeros(part.shape[0])
    deviation_along(_part(given, begin, max(end, begin)), part, part_distance)
    for k in range(part.shape[0]):
        row = min(int(first) + k, rows - 1)
        distance[row] = max(distance[row], part_distance[k])


@inlined
def _place(line: Floats, along: Floats, expected: float, x: float, y: float) -> float:
    """Number of the vertex, with a share, of the place nearest to a point around an arc [m]."""
    around = _REACH + _DRIFT * abs(expected)
    low, high = 0, line.shape[0] - 1
    while low < high - 1 and along[low + 1] < expected - around:
        low += 1
    while high > low + 1 and along[high - 1] > expected + around:
        high -= 1
    k, share, _ = _nearest(line, low, high, x, y)
    return k + share


@inlined
def _arc_at(along: Floats, place: float) -> float:
    k = min(int(place), along.shape[0] - 2)
    return float(along[k] + (place - k) * (along[k + 1] - along[k]))


@kernel
def _part(line: Floats, begin: float, end: float) -> Floats:
    """The polyline between two of its places: both of them, and the vertices in between."""
    first, beyond = int(begin) + 1, math.ceil(end)
    part = np.empty((max(beyond - first, 0) + 2, 2))
    for axis in range(2):
        for row, place in ((0, begin), (part.shape[0] - 1, end)):
            k = min(int(place), line.shape[0] - 2)
            share = place - k
            part[row, axis] = line[k, axis] + share * (line[k + 1, axis] - line[k, axis])
        for row in range(1, part.shape[0] - 1):
            part[row, axis] = line[first + row - 1, axis]
    return part
