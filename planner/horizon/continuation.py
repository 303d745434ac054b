"""The previous plan in this cycle: continued, left unchanged, or braked to a stop.

All of it happens on the stations of that plan. Its remainder is one of the profiles that are
possible now; if nothing got worse, the verifier can have no objection (docs/decisions/0008).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.answer import Deficit
from slopewise.planner.horizon.cycle_planner import CyclePlanner
from slopewise.planner.horizon.path_projection import PathProjection
from slopewise.planner.horizon.polyline import Polyline, station_of
from slopewise.planner.horizon.previous_plan import BEHIND, OfferedPath, PreviousPlan
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.plan_finalizer import Unfinished, keep
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch
from slopewise.planner.plan import Status
from slopewise.planner.verify.verifier import Violations

_LONG = 0.5
"""A plan that takes longer than that to the next station crawls [s]."""

_EXACT = 1e-6
"""Accelerations closer than this are the same [m/s²]."""


@dataclass(frozen=True, slots=True)
class PathAhead:
    """A path to continue along, with stations behind the vehicle.

    Attributes:
        path: a batch of one. first: station of it behind which the vehicle is.
        clear: station up to which it is free [m]; start: speed at its first station [m/s].
    """

    path: PathBatch
    first: int
    clear: float
    start: float


@dataclass(frozen=True)
class Continuation:
    """The previous plan, where the vehicle is on it, and as what its path is offered now.

    Attributes:
        planner: this cycle's.
        previous: the plan; projection: the measured vehicle's on it.
        lead: how much later than there, by the plan, the vehicle is by now [s]: until then the plan
            is driven already.
        offered: None if no candidate is that path.
        untracked: speed of a vehicle that is not at that of the plan, None where it is [m/s]: then
            it can only be stopped on this path.
        fronts: (n, 3) how far other candidates are known to be free: position, and distance from
            the vehicle [m].
    """

    planner: CyclePlanner
    previous: PreviousPlan
    projection: PathProjection
    lead: float
    offered: OfferedPath | None
    untracked: float | None = None
    fronts: Floats = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def _segment(self) -> int:
        return int(self.projection.segment[0])

    @cached_property
    def _now(self) -> tuple[int, float, float]:
        """Segment, station [m] and speed [m/s] of the previous plan where the vehicle is by now."""
        return self.previous.after(self.projection, self.lead)

    @property
    def motion(self) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s²] of the previous plan where it was measured."""
        return self.previous.speed_at(self.projection)

    @property
    def is_at_rest(self) -> bool:
        """The plan comes to rest before the next station."""
        return bool(self.previous.plan.speed[self._now[0] + 1] <= 0.0)

    @property
    def brakes_hard(self) -> bool:
        """By now the vehicle has braked harder than planned braking may."""
        accel = self.previous.plan.accel[self._segment : self._now[0] + 1]
        return bool(-accel.min() > self.planner.model.limits.decel + _EXACT)

    def driven(self, station: Floats) -> tuple[Floats, float]:
        """v² at stations of another candidate that are driven by now [m²/s²], and acceleration.

        It begins where the vehicle was measured.

        Args:
            station: (N,) of the candidate [m].
        """
        plan, here = self.previous.plan, self.previous.station_at(self.projection)
        _, now, _ = self._now
        count = 1 + int(np.searchsorted(station[1:], now - here))
        along = here + station[:count]
        speed_sq = np.interp(along, plan.station, plan.speed**2)
        count = max(int((speed_sq > 0.0).cumprod().sum()), 1)
        k = int(np.searchsorted(plan.station[1:-1], along[count - 1], "right"))
        return speed_sq[:count], float(plan.accel[k])

    @property
    def is_running_out(self) -> bool:
        """The plan brakes or stands, and is never faster again."""
        speed = self.previous.plan.speed[self._now[0] :]
        return bool((speed[1] < speed[0] or speed[1] <= 0.0) and speed.max() <= speed[0])

    @property
    def is_slow_to_next(self) -> bool:
        """The plan rests before the next station, or takes long to it."""
        plan, (k, station, speed) = self.previous.plan, self._now
        mean = 0.5 * (speed + float(plan.speed[k + 1]))
        return self.is_at_rest or float(plan.station[k + 1]) - station > mean * _LONG

    def path_ahead(self) -> PathAhead | None:
        """The path of a plan that continues this one; None if it has to begin again."""
        # What brakes harder than planned braking may has to be planned from where it is by now.
        if self.is_at_rest or self.brakes_hard:
            return None
        return self._path_ahead(BEHIND, extended=True)

    def go_on(self, ahead: PathAhead, solved: TimeOptimalBatch) -> PreviousPlan | None:
        """A new plan that continues from the end of the segment; None if it has to begin again.

        Args:
            ahead: of :meth:`path_ahead`. solved: a batch whose last candidate that is.
        """
        i, plan = self._segment, self.previous.plan
        if solved.bounds.barrier_station[-1] >= ahead.first:
            last = len(solved.cost) - 1
            column = CandidateColumn(solved, last, self._fixed_prefix, ahead.first)
        else:
            ahead, column = self._column(extended=True, behind=BEHIND - 1)
        speed_sq, reachable = column.fastest()
        if not reachable:
            return None
        profile = Unfinished(speed_sq, passed=True, start_accel=float(plan.accel[self._now[0]]))
        first_try = [column]
        answer = self.planner.finish(
            plan.candidate,
            lambda: first_try.pop() if first_try else self._column(extended=True)[1],
            profile,
        )
        # A plan that cannot be repaired stands still, or brakes fully: that is for one that begins
        # here to say, since a segment of a fallback may be faster than its bounds.
        if answer.status is Status.INFEASIBLE or answer.speed[0] != plan.speed[i]:
            return None
        return PreviousPlan.on(ahead.path, ahead.first, answer)

    def keep(self) -> tuple[PreviousPlan | None, Deficit | None]:
        """The remainder of the plan unchanged; or its deficit by what is known now."""
        i, plan = self._segment, self.previous.plan
        ahead, column = self._column(extended=False)
        speed_sq = plan.speed[i:] ** 2
        retained = keep(column, plan.candidate, speed_sq)
        if retained is not None:
            if plan.status is Status.DEGRADED:
                # Where it stops is stated by present knowledge.
                fallback, _, _ = plan.reason.partition("; ")
                reason = "; ".join(filter(None, (fallback, retained.reason)))
                retained = replace(retained, status=plan.status, reason=reason)
            return PreviousPlan.on(ahead.path, ahead.first, retained), None
        if plan.status is Status.DEGRADED:
            return None, None
        verdict = column.verify(speed_sq)
        kind = int(np.argmax(verdict.violation))
        k = int(verdict.where[0]) if len(verdict.where) else 0
        distance = float(plan.station[i + k]) - self.previous.station_at(self.projection)
        name = Violations._fields[kind]
        return None, Deficit(float(verdict.violation[kind]), max(distance, 0.0), name)

    def stop(self, reason: str) -> PreviousPlan | None:
        """Service braking on this path, None if that breaches anything."""
        i, plan = self._segment, self.previous.plan
        ahead, column = self._column(extended=False)
        station = plan.station[i:]
        decel = self.planner.model.limits.decel
        fixed = self._fixed_prefix
        slowing = fixed[-1] - 2.0 * decel * (station - station[len(fixed) - 1])
        speed_sq = np.minimum(plan.speed[i:] ** 2, np.maximum(slowing, 0.0))
        speed_sq[: len(fixed)] = fixed
        stop = keep(column, plan.candidate, speed_sq)
        if stop is None:
            return None
        reason = f"{reason}: stops on the path driven so far"
        deviation = plan.path_deviation
        if deviation is not None:
            deviation = deviation.from_row(i, stop.x, stop.y, stop.station)
        stop = replace(stop, status=Status.DEGRADED, reason=reason, path_deviation=deviation)
        return PreviousPlan.on(ahead.path, ahead.first, stop)

    def _column(self, *, extended: bool, behind: int = BEHIND) -> tuple[PathAhead, CandidateColumn]:
        """The path from the vehicle's segment on, verified with the stations behind it.

        Ground behind the vehicle that is not known any more, or never was, blocks nothing ahead:
        then fewer stations are taken from there.
        """
        for stations in range(behind, -1, -1):
            ahead = self._path_ahead(stations, extended=extended)
            solved = self.planner.solve(ahead.path, np.array([ahead.clear]), ahead.start)
            if solved.bounds.barrier_station[0] >= ahead.first:
                break
        return ahead, CandidateColumn(solved, 0, self._fixed_prefix, ahead.first)

    @property
    def _fixed_prefix(self) -> Floats:
        """v² from where it was measured to the end of the vehicle's segment by now [m²/s²]."""
        if self.untracked is not None:
            return np.full(2, self.untracked**2)
        fixed_prefix: Floats = self.previous.plan.speed[self._segment : self._now[0] + 2] ** 2
        return fixed_prefix

    def _path_ahead(self, behind: int, *, extended: bool) -> PathAhead:
        if self.offered is None:
            path, first = self.previous.rest(self.projection, behind)
        else:
            path, first = self.previous.going_on(
                self.projection, self.offered.rows, behind, extended=extended
            )
        start = self.untracked
        if start is None:
            start = float(self.previous.plan.speed[self._segment])
        return PathAhead(path, first, self._clear(path, first), start)

    def _clear(self, path: PathBatch, first: int) -> float:
        """Station of the path up to which it is free: what is offered, else what was known [m]."""
        station = self.planner.stations(path)
        i, plan = self._segment, self.previous.plan
        here = float(station[first]) + self.previous.station_at(self.projection)
        here -= float(plan.station[i])
        line = Polyline(path.x[:, 0], path.y[:, 0])
        if self.offered is not None:
            return station_of(line, station, self.offered.far, here + self.offered.free)
        clear = float(station[first] + plan.clear_distance - plan.station[i])
        # What ends the free way of a candidate within the width of the body is on this path too.
        for x, y, free in self.fronts.tolist():
            end = station_of(line, station, (x, y), here + free)
            gap = math.hypot(
                float(np.interp(end, station, line.x)) - x,
                float(np.interp(end, station, line.y)) - y,
            )
            if gap <= self.planner.model.vehicle.shape.width:
                clear = min(clear, end)
        return clear
