"""The plan of the last cycle on its own stations, and how its path goes on from there.

It keeps its stations, so that this plan is one of the next cycle's profiles, exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.path_projection import PathProjection, locate
from slopewise.planner.horizon.polyline import Polyline, limits_along, window
from slopewise.planner.path import PathBatch
from slopewise.planner.plan import SpeedPlan

BEHIND = 2
"""Stations kept behind the vehicle: a station's force is that of its neighbours too, and their
headings are those of theirs."""


class OfferedStations(NamedTuple):
    """A path as it is offered now: n stations from a few behind the vehicle on.

    Attributes:
        line: their positions.
        limit: (n,) limits of the path itself [m/s], None if it has none.
        follower_offset: (n,) distance from it of a vehicle on what was given [m], or None.
    """

    line: Polyline
    limit: Floats | None
    follower_offset: Floats | None = None


@dataclass(frozen=True, slots=True)
class PreviousPlan:
    """The plan that was chosen last, of N stations.

    Attributes:
        plan: as it was answered.
        speed_limit: (N,) limits of the path itself [m/s], None if it has none.
        behind: stations that the path had before those of the plan, at most `BEHIND`.
        follower_offset: (N,) distance from it of a vehicle on what was given [m], or None.
    """

    plan: SpeedPlan
    speed_limit: Floats | None
    behind: Polyline
    follower_offset: Floats | None = None

    @classmethod
    def on(cls, path: PathBatch, first: int, plan: SpeedPlan) -> PreviousPlan:
        """A plan that begins at station ``first`` of a path."""
        limit, offset = (
            None if a is None else a[first:, 0] for a in (path.speed_limit, path.follower_offset)
        )
        behind = slice(max(first - BEHIND, 0), first)
        return cls(plan, limit, Polyline(path.x[behind, 0], path.y[behind, 0]), offset)

    def locate(self, at: tuple[float, float], heading: float) -> PathProjection:
        """The vehicle at a position [m] and heading [rad] on the plan's path."""
        x, y = self.plan.x[:, None], self.plan.y[:, None]
        return locate(x, y, np.array([len(x)]), at, heading)

    def _share(self, projection: PathProjection) -> float:
        """How much of its segment the vehicle has driven."""
        x, y, i = self.plan.x, self.plan.y, int(projection.segment[0])
        step = math.hypot(x[i + 1] - x[i], y[i + 1] - y[i])
        gone = math.hypot(projection.x[0] - x[i], projection.y[0] - y[i])
        return min(gone / max(step, 1e-9), 1.0)

    def speed_at(self, projection: PathProjection) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s²] of the plan where the vehicle is."""
        plan, i, u = self.plan, int(projection.segment[0]), self._share(projection)
        speed_sq = (1.0 - u) * plan.speed[i] ** 2 + u * plan.speed[i + 1] ** 2
        return math.sqrt(speed_sq), float(plan.accel[i])

    def station_at(self, projection: PathProjection) -> float:
        """Station of the vehicle on the plan [m]."""
        station, i = self.plan.station, int(projection.segment[0])
        return float(station[i] + self._share(projection) * (station[i + 1] - station[i]))

    def time_at(self, projection: PathProjection) -> float:
        """Time of the plan where the vehicle is [s]."""
        plan, i = self.plan, int(projection.segment[0])
        mean = 0.5 * float(plan.speed[i] + self.speed_at(projection)[0])
        gone = self._share(projection) * float(plan.station[i + 1] - plan.station[i])
        return float(plan.time[i]) + (gone / mean if mean > 0.0 else 0.0)

    def ahead(self, projection: PathProjection) -> Polyline:
        """The vehicle's projection and the stations after it."""
        i = int(projection.segment[0])
        return Polyline(
            np.concatenate((projection.x, self.plan.x[i + 1 :])),
            np.concatenate((projection.y, self.plan.y[i + 1 :])),
        )

    def agrees(self, projection: PathProjection, other: Polyline, tolerance: float) -> bool:
        """Does a path run along this one from the vehicle on, as far as both go?

        Args:
            projection: the vehicle on this path.
            other: stations of the other path, from the vehicle on.
            tolerance: [m].
        """
        ahead = self.ahead(projection)
        common = other.arc() <= ahead.arc()[-1]
        nearest, share, off = ahead.foot(Polyline(other.x[common], other.y[common]))
        # What lies before or beyond this path says nothing.
        before = (nearest == 0) & (share < 0.0)
        beyond = (nearest == len(ahead.x) - 2) & (share > 1.0)
        return bool(np.all((off <= tolerance) | before | beyond))

    def rest(self, projection: PathProjection, behind: int = BEHIND) -> tuple[PathBatch, int]:
        """The path around and ahead of the vehicle.

        Args:
            projection: the vehicle on this path.
            behind: stations before the segment in which it is, if there are so many.

        Returns:
            The path, and the index in it of the station behind the vehicle.
        """
        i, known = int(projection.segment[0]), len(self.behind.x)
        first = max(known + i - behind, 0)
        x, y = (
            np.concatenate((early, late))[first:]
            for early, late in ((self.behind.x, self.plan.x), (self.behind.y, self.plan.y))
        )
        # What the vehicle has left says nothing of what is ahead.
        limit, offset = (
            None if a is None else np.concatenate((np.full(known, nothing), a))[first:]
            for a, nothing in ((self.speed_limit, np.inf), (self.follower_offset, 0.0))
        )
        return self._alone(x, y, limit, offset), known + i - first

    def going_on(
        self,
        projection: PathProjection,
        offered: OfferedStations,
        behind: int = BEHIND,
        *,
        extended: bool,
    ) -> tuple[PathBatch, int]:
        """As :meth:`rest`, under the limits of the path as it is offered now.

        Args:
            projection: the vehicle on this path.
            offered: the same path.
            behind: as of :meth:`rest`.
            extended: with the stations with which the path goes on now.
        """
        path, first = self.rest(projection, behind)
        line, limit, away = offered
        begin = self._extension(projection, line) if extended else len(line.x)
        limits = None
        if limit is not None or path.speed_limit is not None:
            new = np.full(len(line.x), np.inf) if limit is None else limit
            now = limits_along(Polyline(path.x[:, 0], path.y[:, 0]), first, line, new)
            if path.speed_limit is not None:
                now = np.minimum(now, path.speed_limit[:, 0])
            limits = np.concatenate((now, new[begin:]))
        offset = None
        if away is not None or path.follower_offset is not None:
            now = (
                np.zeros(len(path.x))
                if path.follower_offset is None
                else path.follower_offset[:, 0]
            )
            new = np.zeros(len(line.x)) if away is None else away
            offset = np.concatenate((now, new[begin:]))
        x = np.concatenate((path.x[:, 0], line.x[begin:]))
        y = np.concatenate((path.y[:, 0], line.y[begin:]))
        return self._alone(x, y, limits, offset), first

    def _extension(self, projection: PathProjection, offered: Polyline) -> int:
        """Index of the first offered station beyond the end of this path."""
        x, y = self.plan.x, self.plan.y
        step = float(np.hypot(x[-1] - x[-2], y[-1] - y[-2]))
        direction = (x[-1] - x[-2]) / step, (y[-1] - y[-2]) / step
        length = float(self.ahead(projection).arc()[-1])
        here, _, _ = offered.foot(
            Polyline(projection.x, projection.y), high=min(BEHIND + 2, len(offered.x) - 1)
        )
        along = offered.arc()
        along = along - along[here[0]]
        off = np.hypot(offered.x - x[-1], offered.y - y[-1])
        near = np.abs(along - length) <= window(length)
        if not near.any():
            return len(offered.x)
        begin = int(np.argmin(np.where(near, off, np.inf)))
        further = (offered.x - x[-1]) * direction[0] + (offered.y - y[-1]) * direction[1]
        while begin < len(offered.x) and further[begin] < 0.5 * step:
            begin += 1
        return begin

    def _alone(
        self, x: Floats, y: Floats, limit: Floats | None, offset: Floats | None
    ) -> PathBatch:
        """One path as a batch."""
        columns = [None if a is None else np.ascontiguousarray(a[:, None]) for a in (limit, offset)]
        x, y = (np.ascontiguousarray(values[:, None]) for values in (x, y))
        count = np.array([len(x)], np.int64)
        return PathBatch((self.plan.candidate,), x, y, count, columns[0], (), columns[1])
