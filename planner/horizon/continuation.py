"""The path that is being driven, and how it goes on from one cycle to the next.

It keeps its stations, so that the plan of the last cycle is one of this cycle's profiles, exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.horizon.path_projection import PathProjection, locate, project
from planner.kernels.compiled import Floats, Ints, kernel
from planner.path import PathBatch
from planner.plan import SpeedPlan

BEHIND = 2
"""Stations kept behind the vehicle: a station's force is that of its neighbours too, and their
headings are those of theirs."""

_WINDOW = 1.0
_DRIFT = 0.1
"""A place is looked for on so much of another path, a metre and a share of the way there [m]."""

_AT_END = 1e-6


class Points(NamedTuple):
    """Positions of stations, (N,) [m]."""

    x: Floats
    y: Floats

    def arc(self) -> Floats:
        """Distance from the first one in the plan view, (N,) [m]."""
        arc = np.zeros(len(self.x))
        _arc(self.x, self.y, arc)
        return arc

    def foot(
        self, x: Floats, y: Floats, low: int = 0, high: int | None = None
    ) -> tuple[Ints, Floats, Floats]:
        """Where other points are on this polyline.

        Args:
            x, y: (n,) positions [m].
            low, high: segments among which the nearest is looked for; all of them if left out.

        Returns:
            (n,) nearest segments; shares of them, < 0 before and > 1 beyond; distances [m].
        """
        segment, share, off = np.empty(len(x), np.int64), np.empty(len(x)), np.empty(len(x))
        last = len(self.x) - 1
        _foot(self.x, self.y, x, y, low, last if high is None else high, segment, share, off)
        return segment, share, off


@kernel
def _arc(x: Floats, y: Floats, arc: Floats) -> None:
    for i in range(1, x.shape[0]):
        arc[i] = arc[i - 1] + np.hypot(x[i] - x[i - 1], y[i] - y[i - 1])


@kernel
def _foot(
    own_x: Floats, own_y: Floats, x: Floats, y: Floats, low: int, high: int,
    segment: Ints, share: Floats, off: Floats,
) -> None:  # fmt: skip
    for j in range(x.shape[0]):
        segment[j], share[j], least = low, 0.0, np.inf
        for i in range(low, high):
            u, away = project(own_x[i], own_y[i], own_x[i + 1], own_y[i + 1], x[j], y[j])
            if away < least:
                segment[j], share[j], least = i, u, away
        off[j] = np.sqrt(least)


@dataclass(frozen=True, slots=True)
class Driven:
    """The plan that is being driven, on its own stations.

    Attributes:
        plan: as it was emitted.
        speed_limit: (N,) limits of the path itself [m/s], None if it has none.
        behind: stations that the path had before those of the plan, at most `BEHIND`.
    """

    plan: SpeedPlan
    speed_limit: Floats | None
    behind: Points

    def locate(self, at: tuple[float, float], heading: float) -> PathProjection:
        """The vehicle on the plan's path."""
        x, y = self.plan.x[:, None], self.plan.y[:, None]
        return locate(x, y, np.array([len(x)]), at, heading)

    def _share(self, place: PathProjection) -> float:
        """How much of its segment the vehicle has driven."""
        x, y, i = self.plan.x, self.plan.y, int(place.segment[0])
        step = math.hypot(x[i + 1] - x[i], y[i + 1] - y[i])
        gone = math.hypot(place.x[0] - x[i], place.y[0] - y[i])
        return min(gone / max(step, 1e-9), 1.0)

    def speed_at(self, place: PathProjection) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s²] of the plan where the vehicle is."""
        plan, i, u = self.plan, int(place.segment[0]), self._share(place)
        speed_sq = (1.0 - u) * plan.speed[i] ** 2 + u * plan.speed[i + 1] ** 2
        return math.sqrt(speed_sq), float(plan.accel[i])

    def station_at(self, place: PathProjection) -> float:
        """Station of the vehicle on the plan [m]."""
        station, i = self.plan.station, int(place.segment[0])
        return float(station[i] + self._share(place) * (station[i + 1] - station[i]))

    def time_at(self, place: PathProjection) -> float:
        """Time of the plan where the vehicle is [s]."""
        plan, i = self.plan, int(place.segment[0])
        mean = 0.5 * float(plan.speed[i] + self.speed_at(place)[0])
        gone = self._share(place) * float(plan.station[i + 1] - plan.station[i])
        return float(plan.time[i]) + (gone / mean if mean > 0.0 else 0.0)

    def ahead(self, place: PathProjection) -> Points:
        """The vehicle's place and the stations after it."""
        i = int(place.segment[0])
        return Points(
            np.concatenate((place.x, self.plan.x[i + 1 :])),
            np.concatenate((place.y, self.plan.y[i + 1 :])),
        )

    def agrees(self, place: PathProjection, x: Floats, y: Floats, tolerance: float) -> bool:
        """Does a path run along this one from the vehicle on, as far as both go?

        Args:
            place: the vehicle on this path.
            x, y: (n,) stations of the other path, from the vehicle on [m].
            tolerance: [m].
        """
        own = self.ahead(place)
        common = Points(x, y).arc() <= own.arc()[-1]
        nearest, share, off = own.foot(x[common], y[common])
        # What lies before or beyond this path says nothing.
        before = (nearest == 0) & (share < 0.0)
        beyond = (nearest == len(own.x) - 2) & (share > 1.0)
        return bool(np.all((off <= tolerance) | before | beyond))

    def rest(self, place: PathProjection, behind: int = BEHIND) -> tuple[PathBatch, int]:
        """The path around and ahead of the vehicle.

        Args:
            place: the vehicle on this path.
            behind: stations before the segment in which it is, if there are so many.

        Returns:
            The path, and the index in it of the station behind the vehicle.
        """
        i, known = int(place.segment[0]), len(self.behind.x)
        first = max(known + i - behind, 0)
        x, y = (
            np.concatenate((early, late))[first:]
            for early, late in ((self.behind.x, self.plan.x), (self.behind.y, self.plan.y))
        )
        limit = self.speed_limit
        if limit is not None:
            # What the vehicle has left says nothing of what is ahead.
            limit = np.concatenate((np.full(known, np.inf), limit))[first:]
        return _alone(self.plan, x, y, limit), known + i - first

    def going_on(
        self,
        place: PathProjection,
        offered: tuple[Floats, Floats, Floats | None],
        behind: int = BEHIND,
        *,
        extended: bool,
    ) -> tuple[PathBatch, int]:
        """As :meth:`rest`, under the limits of the path as it is offered now.

        Args:
            place: the vehicle on this path.
            offered: stations x, y and limits (n,), from a few behind the vehicle on [m, m, m/s].
            behind: as of :meth:`rest`.
            extended: with the stations with which the path goes on now.
        """
        path, first = self.rest(place, behind)
        x, y, limit = offered
        begin = self._extension(place, x, y) if extended else len(x)
        limits = None
        if limit is not None or path.speed_limit is not None:
            new = np.full(len(x), np.inf) if limit is None else limit
            now = _limits_along(Points(path.x[:, 0], path.y[:, 0]), first, x, y, new)
            if path.speed_limit is not None:
                now = np.minimum(now, path.speed_limit[:, 0])
            limits = np.concatenate((now, new[begin:]))
        further = (
            np.concatenate((path.x[:, 0], x[begin:])),
            np.concatenate((path.y[:, 0], y[begin:])),
        )
        return _alone(self.plan, *further, limits), first

    def _extension(self, place: PathProjection, x: Floats, y: Floats) -> int:
        """Index of the first offered station beyond the end of this path."""
        own_x, own_y = self.plan.x, self.plan.y
        step = float(np.hypot(own_x[-1] - own_x[-2], own_y[-1] - own_y[-2]))
        direction = (own_x[-1] - own_x[-2]) / step, (own_y[-1] - own_y[-2]) / step
        length = float(self.ahead(place).arc()[-1])
        points = Points(x, y)
        here, _, _ = points.foot(place.x, place.y, high=min(BEHIND + 2, len(x) - 1))
        along = points.arc()
        along = along - along[here[0]]
        off = np.hypot(x - own_x[-1], y - own_y[-1])
        near = np.abs(along - length) <= _WINDOW + _DRIFT * length
        if not near.any():
            return len(x)
        begin = int(np.argmin(np.where(near, off, np.inf)))
        further = (x - own_x[-1]) * direction[0] + (y - own_y[-1]) * direction[1]
        while begin < len(x) and further[begin] < 0.5 * step:
            begin += 1
        return begin


def reached(path: Points, station: Floats, place: tuple[float, float], expected: float) -> float:
    """Station of a place on a path; inf at its end and beyond.

    Args:
        path: (N,) stations; station: (N,) of them along the ground [m].
        place: on another path that runs along this one [m].
        expected: about where it is: the path may cross itself [m].
    """
    window = _WINDOW + _DRIFT * abs(expected)
    low = int(np.searchsorted(station[1:], expected - window))
    high = int(np.searchsorted(station[:-1], expected + window, "right"))
    if low >= high:
        return np.inf if expected > station[-1] else 0.0
    segment, share, _ = path.foot(np.array([place[0]]), np.array([place[1]]), low, high)
    k, u = int(segment[0]), float(share[0])
    if k == len(station) - 2 and u >= 1.0 - _AT_END:
        return np.inf
    return float(station[k] + min(max(u, 0.0), 1.0) * (station[k + 1] - station[k]))


def _limits_along(path: Points, first: int, x: Floats, y: Floats, limit: Floats) -> Floats:
    """Limits of another path at the stations of one that runs along it, (N,) [m/s].

    Between two stations of the other path the lower limit counts; up to station ``first``, where
    the vehicle has been, either one allowed it to be.
    """
    k, u, _ = Points(x, y).foot(path.x, path.y)
    lower, higher = np.minimum(limit[k], limit[k + 1]), np.maximum(limit[k], limit[k + 1])
    between = np.where(np.arange(len(k)) <= first, higher, lower)
    here: Floats = np.where(u >= 1.0 - _AT_END, limit[k + 1], between)
    here = np.where(u <= _AT_END, limit[k], here)
    # Before the other path begins it has no say.
    return np.where((k == 0) & (u < -_AT_END), np.inf, here)


def _alone(plan: SpeedPlan, x: Floats, y: Floats, limit: Floats | None) -> PathBatch:
    """One path as a batch."""
    column = None if limit is None else np.ascontiguousarray(limit[:, None])
    count = np.array([len(x)], np.int64)
    return PathBatch(
        (plan.candidate,), np.ascontiguousarray(x[:, None]), np.ascontiguousarray(y[:, None]),
        count, column,
    )  # fmt: skip
