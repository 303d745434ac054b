"""The plan of the last cycle in this one: gone on with, kept as it is, or braked to a stop.

All of it happens on the stations of that plan. What is left of it is one of the profiles that are
possible now; if nothing got worse, the judge can have no objection (docs/decisions/0008).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planner.horizon.answer import Deficit
from planner.horizon.continuation import BEHIND, Driven, Points, reached
from planner.horizon.cycle_planner import CyclePlanner, Work
from planner.horizon.path_projection import PathProjection
from planner.kernels.compiled import Floats
from planner.path import PathBatch
from planner.pipeline.candidates import TimeOptimalBatch
from planner.pipeline.plan_finalizer import PlanFinalizer
from planner.plan import SpeedPlan, Status
from planner.verify.judge import Violations

_LONG = 0.5
"""A plan that takes longer than that to the next station crawls [s]."""

_EXACT = 1e-6
"""Accelerations closer than this are the same [m/s²]."""


@dataclass(frozen=True, slots=True)
class Offered:
    """The driven path as it is offered in this cycle.

    Attributes:
        x, y: (n,) stations from a few behind the vehicle on [m].
        limit: (n,) limits of the path itself [m/s], None if it has none.
        far: end of the path or of the free way, whichever is first [m].
        free: way along the ground from the vehicle to there [m].
    """

    x: Floats
    y: Floats
    limit: Floats | None
    far: tuple[float, float]
    free: float


def offered_path(
    path: PathBatch, segment: int, station: Floats, left: float, clear: float
) -> Offered:
    """What a path offers.

    Args:
        path: as it came, alone; segment: index of its station behind the vehicle.
        station: (n,) stations of it along the ground [m].
        left: station of the vehicle on it; clear: station up to which it is free [m].
    """
    n, first = int(path.count[0]), max(segment - BEHIND, 0)
    end = min(max(clear, 0.0), float(station[n - 1]))
    far = tuple(float(np.interp(end, station[:n], a[:n, 0])) for a in (path.x, path.y))
    limit = None if path.speed_limit is None else path.speed_limit[first:n, 0]
    x, y = path.x[first:n, 0], path.y[first:n, 0]
    return Offered(x, y, limit, (far[0], far[1]), end - left)


@dataclass(frozen=True, slots=True)
class Way:
    """A path to go on along, with stations behind the vehicle.

    Attributes:
        path: as a batch of one. first: station of it behind which the vehicle is.
        clear: station up to which it is free [m]; start: speed at its first station [m/s].
    """

    path: PathBatch
    first: int
    clear: float
    start: float


@dataclass(frozen=True, slots=True)
class PreviousPlanFollower:
    """The plan driven so far, where the vehicle is on it, and as what it is offered now.

    Attributes:
        driven: the plan; place: of the vehicle on it.
        offered: None if no candidate is that path.
    """

    planner: CyclePlanner
    driven: Driven
    place: PathProjection
    offered: Offered | None

    @property
    def _segment(self) -> int:
        return int(self.place.segment[0])

    @property
    def rests(self) -> bool:
        """The plan comes to rest before the next station."""
        return bool(self.driven.plan.speed[self._segment + 1] <= 0.0)

    @property
    def lingers(self) -> bool:
        """The plan rests before the next station, or takes long to it."""
        plan, i = self.driven.plan, self._segment
        left = float(plan.station[i + 1]) - self.driven.station_at(self.place)
        mean = 0.5 * (self.driven.speed_at(self.place)[0] + float(plan.speed[i + 1]))
        return self.rests or left > mean * _LONG

    def way_on(self) -> Way | None:
        """The way of a plan that goes on from this one; None if it has to begin anew."""
        # What brakes harder than planned braking may has to be planned from where it is by now.
        service = self.planner.equipment.model.limits.decel
        if self.rests or -self.driven.plan.accel[self._segment] > service + _EXACT:
            return None
        return self._way(BEHIND, extended=True)

    def go_on(self, way: Way, solved: TimeOptimalBatch, limit: Floats | None) -> Driven | None:
        """A new plan that goes on from the end of the segment; None if it has to begin anew.

        Args:
            way: of :meth:`way_on`. solved: a batch whose last candidate that is. limit: of all of
                them [m/s].
        """
        i, plan = self._segment, self.driven.plan
        path, first = way.path, way.first
        if solved.bounds.barrier_station[-1] >= first:
            j = len(solved.cost) - 1
            finalizer = self.planner.finalizer(solved, j, self._fixed_prefix, limit, first)
        else:
            path, first, finalizer = self._finalizer(extended=True, behind=BEHIND - 1)
        speed_sq, reachable = finalizer.fastest()
        if not reachable:
            return None
        work = Work(speed_sq, innocent=True, start_accel=float(plan.accel[i]))
        again = [finalizer]
        answer = self.planner.finish(
            plan.candidate,
            lambda: again.pop() if again else self._finalizer(extended=True)[2],
            work,
        )
        # A plan that cannot be repaired stands still: that is none for a vehicle that moves.
        return _driven(answer, path, first) if answer.speed[0] == plan.speed[i] else None

    def keep(self) -> tuple[Driven | None, Deficit | None]:
        """What is left of the plan, as it is; or what it lacks by what is known now."""
        i, plan = self._segment, self.driven.plan
        path, first, finalizer = self._finalizer(extended=False)
        speed_sq = plan.speed[i:] ** 2
        kept = finalizer.keep(plan.candidate, speed_sq)
        if kept is not None:
            if plan.status is Status.DEGRADED:
                kept = replace(kept, status=plan.status, reason=plan.reason)
            return _driven(kept, path, first), None
        if plan.status is Status.DEGRADED:
            return None, None
        verdict = finalizer.judge(speed_sq)
        kind = int(np.argmax(verdict.violation))
        k = int(verdict.where[0]) if len(verdict.where) else 0
        distance = float(plan.station[i + k]) - self.driven.station_at(self.place)
        name = Violations._fields[kind]
        return None, Deficit(float(verdict.violation[kind]), max(distance, 0.0), name)

    def stop(self, why: str) -> Driven | None:
        """Service braking on this path, None if that breaches anything."""
        i, plan = self._segment, self.driven.plan
        path, first, finalizer = self._finalizer(extended=False)
        station = plan.station[i:]
        decel = self.planner.equipment.model.limits.decel
        slowing = plan.speed[i + 1] ** 2 - 2.0 * decel * (station - station[1])
        speed_sq = np.minimum(plan.speed[i:] ** 2, np.maximum(slowing, 0.0))
        speed_sq[:2] = plan.speed[i : i + 2] ** 2
        stop = finalizer.keep(plan.candidate, speed_sq)
        if stop is None:
            return None
        reason = f"{why}: stops on the path driven so far"
        return _driven(replace(stop, status=Status.DEGRADED, reason=reason), path, first)

    def _finalizer(
        self, *, extended: bool, behind: int = BEHIND
    ) -> tuple[PathBatch, int, PlanFinalizer]:
        """The path from the vehicle's segment on, judged with the stations behind it.

        Ground behind the vehicle that is not known any more, or never was, bars nothing ahead: then
        fewer stations are taken from there.
        """
        for some in range(behind, -1, -1):
            way = self._way(some, extended=extended)
            path, first = way.path, way.first
            solved = self.planner.solve(path, np.array([way.clear]), way.start)
            if solved.bounds.barrier_station[0] >= first:
                break
        return (
            path,
            first,
            self.planner.finalizer(solved, 0, self._fixed_prefix, path.speed_limit, first),
        )

    @property
    def _fixed_prefix(self) -> Floats:
        """v² at both ends of the vehicle's segment, (2,) [m²/s²]."""
        i = self._segment
        fixed_prefix: Floats = self.driven.plan.speed[i : i + 2] ** 2
        return fixed_prefix

    def _way(self, behind: int, *, extended: bool) -> Way:
        if self.offered is None:
            path, first = self.driven.rest(self.place, behind)
        else:
            now = self.offered.x, self.offered.y, self.offered.limit
            path, first = self.driven.going_on(self.place, now, behind, extended=extended)
        start = float(self.driven.plan.speed[self._segment])
        return Way(path, first, self._clear(path, first), start)

    def _clear(self, path: PathBatch, first: int) -> float:
        """Station of the path up to which it is free: what is offered, else what was known [m]."""
        station = self.planner.stations(path)
        i, plan = self._segment, self.driven.plan
        if self.offered is None:
            return float(station[first] + plan.clear_distance - plan.station[i])
        here = self.driven.station_at(self.place) - float(plan.station[i])
        expected = float(station[first]) + here + self.offered.free
        points = Points(path.x[:, 0], path.y[:, 0])
        return reached(points, station, self.offered.far, expected)


def _driven(plan: SpeedPlan, path: PathBatch, first: int) -> Driven:
    """A plan that begins at station ``first`` of a path."""
    limit = None if path.speed_limit is None else path.speed_limit[first:, 0]
    early = slice(max(first - BEHIND, 0), first)
    return Driven(plan, limit, Points(path.x[early, 0], path.y[early, 0]))
