"""The plan of the last cycle on its own stations, and how its path continues from there.

It keeps its stations, so that this plan is one of the next cycle's profiles, exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.path_projection import PathProjection, locate_on
from slopewise.planner.horizon.polyline import Polyline, limits_along, window
from slopewise.planner.path import PathBatch
from slopewise.planner.plan import SpeedPlan

BEHIND = 2
"""Stations kept behind the vehicle: a station's force is that of its neighbours too, and their
headings are those of theirs."""


@dataclass(frozen=True, slots=True)
class PreviousPlan:
    """The plan that was chosen last, of N stations.

    Attributes:
        plan: the answer.
        limits: (2, N) speed limit of the path itself [m/s], and distance from it of a vehicle on
            what was given [m].
        behind: (2, n) positions of the path before those of the plan [m], at most `BEHIND`.
        measured: time of the plan where the vehicle was measured when it was chosen [s].
        lead: how much later, by the plan, the vehicle was commanded to be then [s].
    """

    plan: SpeedPlan
    limits: Floats
    behind: Floats
    measured: float = 0.0
    lead: float = 0.0

    @classmethod
    def on(cls, path: PathBatch, first: int, plan: SpeedPlan) -> PreviousPlan:
        """A plan that begins at station ``first`` of a path."""
        rows = path.rows[:, : first + len(plan.x), 0]
        return cls(plan, rows[2:, first:], rows[:2, max(first - BEHIND, 0) : first])

    def locate(self, at: tuple[float, float], heading: float) -> PathProjection:
        """The vehicle at a position [m] and heading [rad] on the plan's path."""
        return locate_on(self.plan.x, self.plan.y, at, heading)

    def _share(self, projection: PathProjection) -> float:
        """How much of its segment the vehicle has driven, < 0 before the first one."""
        x, y, i = self.plan.x, self.plan.y, int(projection.segment[0])
        step = math.hypot(x[i + 1] - x[i], y[i + 1] - y[i])
        gone = math.hypot(projection.x[0] - x[i], projection.y[0] - y[i])
        return min((gone or min(float(projection.along[0]), 0.0)) / max(step, 1e-9), 1.0)

    def speed_at(self, projection: PathProjection) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s²] of the plan where the vehicle is."""
        plan, i, u = self.plan, int(projection.segment[0]), self._share(projection)
        speed_sq = (1.0 - u) * plan.speed[i] ** 2 + u * plan.speed[i + 1] ** 2
        return math.sqrt(max(speed_sq, 0.0)), float(plan.accel[i])

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

    def lead_at(self, projection: PathProjection, age: float, period: float) -> float:
        """How much later than at its measured place, by the plan, the vehicle is by now [s].

        Where it has obeyed, the age of the measurement; but commands go no farther than a period
        beyond those of the last cycle, while a vehicle begins to drive.

        Args:
            projection: vehicle as measured, on this plan. age: time since then [s].
            period: from one cycle to the next [s].
        """
        advance = self.time_at(projection) - self.measured
        return min(age, self.lead + max(period - advance, 0.0))

    def after(self, projection: PathProjection, lead: float) -> tuple[int, float, float]:
        """Segment, station [m] and speed [m/s] of the plan a time after the vehicle's place [s]."""
        plan, i = self.plan, int(projection.segment[0])
        here, (speed, _) = self.station_at(projection), self.speed_at(projection)
        if lead <= 0.0:
            return i, here, speed
        later = min(self.time_at(projection) + lead, plan.travel_time)
        k = int(np.searchsorted(plan.time, later)) - 1
        if k < i:
            return i, here, speed
        gone = later - float(plan.time[k])
        speed = max(float(plan.speed[k] + plan.accel[k] * gone), 0.0)
        return k, float(plan.station[k]) + 0.5 * gone * (float(plan.speed[k]) + speed), speed

    def left(self, at: tuple[float, float], heading: float) -> tuple[float, float]:
        """Time [s] and distance [m] to the plan's rest from a position [m] and heading [rad]."""
        projection = self.locate(at, heading)
        time = self.plan.travel_time - self.time_at(projection)
        return time, self.plan.progress - self.station_at(projection)

    def ahead(self, projection: PathProjection) -> Polyline:
        """The vehicle's projection and the stations after it."""
        i = int(projection.segment[0])
        return Polyline(
            np.concatenate((projection.x, self.plan.x[i + 1 :])),
            np.concatenate((projection.y, self.plan.y[i + 1 :])),
        )

    def agrees(self, projection: PathProjection, offered: Polyline, tolerance: float) -> bool:
        """Return True if a path runs along this one from the vehicle on, as far as both go.

        Args:
            projection: the vehicle on this path.
            offered: stations of the path compared with it, from the vehicle on.
            tolerance: [m].
        """
        ahead = self.ahead(projection)
        common = offered.arc() <= ahead.arc()[-1]
        nearest, share, gap = ahead.foot(Polyline(offered.x[common], offered.y[common]))
        # Parts before or beyond this path are ignored.
        before = (nearest == 0) & (share < 0.0)
        beyond = (nearest == len(ahead.x) - 2) & (share > 1.0)
        return bool(np.all((gap <= tolerance) | before | beyond))

    def rest(self, projection: PathProjection, behind: int = BEHIND) -> tuple[PathBatch, int]:
        """The path around and ahead of the vehicle.

        Args:
            projection: the vehicle on this path.
            behind: stations before the segment in which it is, as far as there are.

        Returns:
            The path, and the index in it of the station behind the vehicle.
        """
        i, known = int(projection.segment[0]), self.behind.shape[1]
        first = max(known + i - behind, 0)
        # Parts behind the vehicle are ignored.
        nothing = np.broadcast_to([[np.inf], [0.0]], (2, known))
        plan = np.stack((self.plan.x, self.plan.y, *self.limits))
        rows = np.concatenate((np.concatenate((self.behind, nothing)), plan), axis=1)
        return self._alone(rows[:, first:]), known + i - first

    def going_on(
        self, projection: PathProjection, offered: Floats, behind: int = BEHIND, *, extended: bool
    ) -> tuple[PathBatch, int]:
        """As :meth:`rest`, under the limits of the path offered now.

        Args:
            projection: the vehicle on this path.
            offered: (4, n) rows of the same path.
            behind: as of :meth:`rest`.
            extended: with the stations by which the path continues now.
        """
        path, first = self.rest(projection, behind)
        line, limit = Polyline(*offered[:2]), offered[2]
        begin = self._extension(projection, line) if extended else len(line.x)
        rows = path.rows[..., 0].copy()
        rows[2] = np.minimum(limits_along(Polyline(*rows[:2]), first, line, limit), rows[2])
        return self._alone(np.concatenate((rows, offered[:, begin:]), axis=1)), first

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
        gap = np.hypot(offered.x - x[-1], offered.y - y[-1])
        near = np.abs(along - length) <= window(length)
        if not near.any():
            return len(offered.x)
        begin = int(np.argmin(np.where(near, gap, np.inf)))
        further = (offered.x - x[-1]) * direction[0] + (offered.y - y[-1]) * direction[1]
        while begin < len(offered.x) and further[begin] < 0.5 * step:
            begin += 1
        return begin

    def _alone(self, rows: Floats) -> PathBatch:
        """One path as a batch, by its rows (4, n)."""
        count = np.array([rows.shape[1]], np.int64)
        return PathBatch((self.plan.candidate,), np.ascontiguousarray(rows[..., None]), count)


@dataclass(frozen=True, slots=True)
class OfferedPath:
    """The path of the previous plan, offered in this cycle.

    Attributes:
        rows: (4, n) of it from a few stations behind the vehicle on, as of :class:`PathBatch`.
        far: end of the path or of the free distance, the nearer one [m].
        free: distance along the ground from the vehicle to there [m].
    """

    rows: Floats
    far: tuple[float, float]
    free: float


def offered_path(
    path: PathBatch, segment: int, station: Floats, passed: float, clear: float
) -> OfferedPath:
    """Offer of a path.

    Args:
        path: as it came, alone; segment: index of its station behind the vehicle.
        station: (n,) stations of it along the ground [m].
        passed: station of the vehicle on it; clear: station up to which it is free [m].
    """
    n, first = int(path.count[0]), max(segment - BEHIND, 0)
    end = min(max(clear, 0.0), float(station[n - 1]))
    far = tuple(float(np.interp(end, station[:n], a[:n, 0])) for a in (path.x, path.y))
    return OfferedPath(path.rows[:, first:n, 0], (far[0], far[1]), end - passed)


def vehicle_on(
    previous: PreviousPlan, state: PlanarState, settings: HorizonSettings
) -> PathProjection | None:
    """The vehicle on the path of the previous plan, None if it is not on it."""
    if state.invalid_field():
        return None
    projection = previous.locate((state.x, state.y), state.heading)
    near = (
        projection.lateral_offset[0] <= settings.beside and projection.along[0] >= -settings.ahead
    )
    return projection if near and projection.turned[0] <= settings.turned else None


def is_tracked(
    previous: PreviousPlan,
    projection: PathProjection,
    speeds: tuple[float, float],
    settings: HorizonSettings,
) -> bool:
    """Return True if the vehicle has about the speed of the previous plan where it is.

    Args:
        previous: the plan; projection: the vehicle's on it.
        speeds: as measured, and the highest until a command of now takes effect [m/s]: a vehicle
            that cannot follow faster commands is on its plan with that one.
        settings: with the error of tracking.
    """
    planned, _ = previous.speed_at(projection)
    return any(abs(max(speed, 0.0) - planned) <= settings.speed_error for speed in speeds)


def index_of(
    previous: PreviousPlan, projection: PathProjection, rest: PathBatch, tolerance: float
) -> int | None:
    """Index of the candidate that is the previous plan's path, None if none is.

    Args:
        previous: the plan; projection: the vehicle's on it.
        rest: candidates from the vehicle on.
        tolerance: how exactly a path of the same name is the same path [m].
    """
    if previous.plan.candidate not in rest.names:
        return None
    j = rest.names.index(previous.plan.candidate)
    n = int(rest.count[j])
    line = Polyline(rest.x[:n, j], rest.y[:n, j])
    return j if previous.agrees(projection, line, tolerance) else None
