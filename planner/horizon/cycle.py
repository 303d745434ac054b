"""One cycle of the moving horizon at work: all candidates judged, the best finished, one chosen."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from time import perf_counter

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, Deficit, Ranked
from slopewise.planner.horizon.choice import SAFE, answer, best_first
from slopewise.planner.horizon.continuation import Continuation, PathAhead
from slopewise.planner.horizon.cycle_batch import BestCandidates, CycleBatch
from slopewise.planner.horizon.cycle_planner import CyclePlanner
from slopewise.planner.horizon.path_cut import cut, passed_stations
from slopewise.planner.horizon.previous_plan import (
    PreviousPlan,
    index_of,
    is_tracked,
    offered_path,
    vehicle_on,
)
from slopewise.planner.horizon.refusals import Drivable, drivable_of
from slopewise.planner.path import PathBatch, joined
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.plan_finalizer import Unfinished
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch
from slopewise.planner.plan import SpeedPlan, Status

_NO_STOP = "no candidate can be stopped on"
"""Why the path of the previous plan is stopped on."""

_FARTHER = 1.0
"""Distance between the ends of a plan without smoothing and of the smooth one that it replaces [m]:
smoothing itself may cost less, and a plan that is ok may rest that far before its path's end."""


class Cycle:
    """One cycle: made, run once, discarded."""

    def __init__(
        self, planner: CyclePlanner, previous: PreviousPlan | None, best: Collection[str] = ()
    ) -> None:
        """Find the vehicle on the plan that it drives; `best` names candidates of before."""
        self._best_before = best
        self._planner, self._settings, self._state = planner, planner.settings, planner.state
        self._lap = planner.started
        self.seconds: dict[str, float] = {}
        self._continuation: Continuation | None = None
        self._former: Continuation | None = None
        self._ahead: PathAhead | None = None
        self._start = planner.unseen.speed
        if previous is None:
            return
        projection = vehicle_on(previous, self._state, self._settings)
        if projection is None:
            return
        if is_tracked(previous, projection, (self._state.speed, self._start), self._settings):
            lead = previous.lead_at(projection, self._state.age, self._settings.period)
            self._continuation = Continuation(planner, previous, projection, lead, None)
            self._start, _ = self._continuation.motion
        self._former = self._continuation or Continuation(
            planner, previous, projection, 0.0, None, self._start
        )

    def run(
        self, paths: PathBatch | None, clear: Floats
    ) -> tuple[CycleAnswer, PreviousPlan | None]:
        """The answer, and the plan that is driven from now on.

        Args:
            paths: M candidates, None without any.
            clear: (M,) station up to which each of them is known to be free [m].
        """
        if invalid := self._state.invalid_field():
            return CycleAnswer(Status.DEGRADED, f"{invalid}: full braking", None, FULL_STOP), None
        if paths is None:
            return self._stop("no candidate is offered", ())
        limit = self._planner.model.max_path_deviation
        candidates, refused = drivable_of(paths, clear, self._state, self._settings, limit)
        if candidates is None:
            return self._stop(f"no candidate can be driven: {refused[0].reason}", refused)
        return self._plan(candidates, refused)

    def _plan(
        self, candidates: Drivable, refused: tuple[Ranked, ...]
    ) -> tuple[CycleAnswer, PreviousPlan | None]:
        """The answer where there are candidates to drive."""
        planner = self._planner
        rest = cut(candidates.paths, candidates.projection, (self._state.x, self._state.y))
        # Plans rest at stations: what a path costs jumps by the distance from one to the next.
        step = float(np.hypot(np.diff(rest.x[1:3], axis=0), np.diff(rest.y[1:3], axis=0)).max())
        gain = self._settings.switch_gain + planner.planning.horizon_penalty * step
        vehicle = planner.model.vehicle
        passed = passed_stations(
            candidates.paths, candidates.projection, planner.elevation_map, vehicle
        )
        index = self._find_previous(candidates, rest, passed)
        together, free = rest, candidates.clear - passed
        starts = np.full(len(passed), self._start)
        if self._ahead is not None:
            # One more candidate costs next to nothing, solved alone as much as twenty.
            together = joined(rest, self._ahead.path)
            free, starts = np.append(free, self._ahead.clear), np.append(starts, self._ahead.start)
        count = max(self._settings.smoothed - (index is not None), 1)
        best = BestCandidates(rest, len(starts), index, gain, count, self._best_before)
        planner.solve(together, free, starts, best)
        self._time("plan")
        batch, order = best.batch, best.order
        continued, deficit, unchanged = self._continue(batch, index)
        plans = [] if continued is None else [continued]
        # The previous plan and the best other candidate are finished at any time.
        for n, j in enumerate([j for j in order if j != index][:count]):
            if n > 0 and planner.late():
                break
            plans.append(self._begin(batch, j))
        self._time("smooth")
        previous = "" if index is None else rest.names[index]
        plans = best_first(planner, plans, continued, previous, gain)
        unchanged = unchanged and plans[0] is continued
        plans = [self._with_deviation(plan, candidates) for plan in plans]
        if index is None and plans[0].plan.status is Status.INFEASIBLE:
            plans = self._stop_on_former(_NO_STOP, batch.fronts(free)) + plans
        finished = tuple(plan.plan for plan in plans)
        ranking = (*batch.ranked(order), *refused)
        chosen = answer(planner, plans[0], finished, ranking, self._lead, deficit, unchanged)
        self._time("choose")
        return chosen

    # ------------------------------------------------------------------ the previous plan

    def _find_previous(self, candidates: Drivable, rest: PathBatch, passed: Floats) -> int | None:
        """Index of the candidate that is the previous plan's path; the continuation notes it."""
        continuation = self._continuation
        if continuation is None:
            return None
        j = index_of(continuation.previous, continuation.projection, rest, self._settings.same_path)
        if j is None:
            return None
        alone = candidates.paths.only(np.array([j]))
        offered = offered_path(
            alone,
            int(candidates.projection.segment[j]),
            self._planner.stations(alone),
            float(passed[j]),
            float(candidates.clear[j]),
        )
        self._continuation = replace(continuation, offered=offered)
        self._ahead = self._continuation.path_ahead()
        if self._leads_away(candidates, j):
            self._continuation, self._ahead = continuation, None
            return None
        return j

    def _leads_away(self, candidates: Drivable, j: int) -> bool:
        """The line that is driven is too far from what is given of its path by now."""
        if self._ahead is not None:
            path, first = self._ahead.path, self._ahead.first
        else:
            assert self._continuation is not None
            path, first = self._continuation.previous.rest(self._continuation.projection)
        x, y = path.x[first:, 0], path.y[first:, 0]
        limit = self._planner.model.max_path_deviation
        return candidates.deviation(j, x, y, x, limit).largest > limit

    def _with_deviation(self, previous: PreviousPlan, candidates: Drivable) -> PreviousPlan:
        """The same, with how far it leads from what is given of its path."""
        plan, limit = previous.plan, self._planner.model.max_path_deviation
        j = candidates.paths.names.index(plan.candidate)
        deviation = candidates.deviation(j, plan.x, plan.y, plan.station, limit)
        given = candidates.paths.given[j] if candidates.paths.given else None
        reason = plan.reason or ("" if given is None else given.ends)
        return replace(previous, plan=replace(plan, path_deviation=deviation, reason=reason))

    def _continue(
        self, batch: CycleBatch, index: int | None
    ) -> tuple[PreviousPlan | None, Deficit | None, bool]:
        """The previous plan in this cycle; what it lacks; is it unchanged?

        Args:
            batch: the candidates. index: the candidate that is its path, if any.
        """
        continuation = self._continuation
        if continuation is None or index is None:
            return None, None, False
        # At a crawl the next station is far away: what is free by now is not waited for.
        is_slow_to_next = continuation.is_slow_to_next
        new = self._begin(batch, index) if is_slow_to_next else self._go_on(batch)
        was_ok = continuation.previous.plan.status is Status.OK
        enough = (Status.OK,) if was_ok else SAFE
        if is_slow_to_next and new is not None and new.plan.status not in enough:
            new = self._go_on(batch) or new
        if new is not None and new.plan.status in SAFE:
            return new, None, False
        old, deficit = continuation.keep()
        if old is not None and (new is None or not self._is_farther(new, old)):
            return old, None, True
        return new or self._begin(batch, index), deficit, False

    def _is_farther(self, fallback: PreviousPlan, old: PreviousPlan) -> bool:
        """A fallback, such as a plan without smoothing, leads on where the previous one runs out.

        Of two fallbacks the cheaper one is driven, by :mod:`slopewise.planner.pipeline.ranking`.
        """
        if fallback.plan.status is not Status.DEGRADED:
            return False
        at, heading = (self._state.x, self._state.y), self._state.heading
        (time, distance), (old_time, old_distance) = (
            plan.left(at, heading) for plan in (fallback, old)
        )
        farther = distance - old_distance
        if old.plan.status is Status.DEGRADED:
            return time - old_time < self._planner.planning.horizon_penalty * farther
        assert self._continuation is not None
        return self._continuation.is_running_out and farther > _FARTHER

    # ------------------------------------------------------------------ plans

    def _go_on(self, batch: CycleBatch) -> PreviousPlan | None:
        """The plan that continues the previous one, None without one."""
        if self._continuation is None or self._ahead is None:
            return None
        return self._continuation.go_on(self._ahead, batch.solved)

    def _begin(self, batch: CycleBatch, j: int) -> PreviousPlan:
        """The plan of a candidate that begins at the vehicle."""
        solved, accel = batch.solved, None
        name, path = batch.paths.names[j], batch.paths.only(np.array([j]))
        start_sq = solved.start_sq[j : j + 1]
        if self._continuation is not None and start_sq[0] > 0.0:
            _, accel = self._continuation.motion
            plan = self._begin_driven(solved, j, name)
            if plan is not None:
                return PreviousPlan.on(path, 0, plan)
        plan = self._planner.finish(
            name,
            lambda: CandidateColumn(solved, j, start_sq),
            Unfinished(solved.profile_of(j), not batch.too_fast[j], batch.passed(j), accel),
        )
        return PreviousPlan.on(path, 0, plan)

    def _begin_driven(self, solved: TimeOptimalBatch, j: int, name: str) -> SpeedPlan | None:
        """The same where the vehicle has driven some of its stations by now, at known speeds.

        None where that is nothing, or more than service braking and the verifier allow there: then
        it has to brake as from where it was measured.
        """
        assert self._continuation is not None
        if self._continuation.lead <= 0.0 or self._continuation.brakes_hard:
            return None
        count = solved.profile.count[j]
        speed_sq, accel = self._continuation.driven(solved.profile.station[:count, j])
        profile, is_reachable = CandidateColumn(solved, j, speed_sq).fastest()
        if len(speed_sq) == 1 or not is_reachable:
            return None
        plan = self._planner.finish(
            name,
            lambda: CandidateColumn(solved, j, speed_sq),
            Unfinished(profile, passed=True, start_accel=accel),
        )
        return None if plan.status is Status.INFEASIBLE else plan

    # ------------------------------------------------------------------ answers

    def _stop(
        self, reason: str, ranking: tuple[Ranked, ...]
    ) -> tuple[CycleAnswer, PreviousPlan | None]:
        """No candidate: braking on the previous plan's path, fully where that is not enough."""
        reason = f"{reason}: full braking"
        full = CycleAnswer(Status.DEGRADED, reason, None, FULL_STOP, ranking=ranking)
        stops = self._stop_on_former(reason)
        if not stops:
            return full, None
        return answer(self._planner, stops[0], (stops[0].plan,), ranking, self._lead)

    def _stop_on_former(self, reason: str, fronts: Floats | None = None) -> list[PreviousPlan]:
        """Service braking on the path that was driven so far, empty where that is not possible.

        Args:
            reason: to brake. fronts: as of :class:`Continuation`.
        """
        former = self._former
        if former is not None and fronts is not None:
            former = replace(former, fronts=fronts)
        stop = None if former is None else former.stop(reason)
        return [] if stop is None else [stop]

    @property
    def _lead(self) -> float:
        """How much later than measured, by its plan, the vehicle is by now [s]."""
        return 0.0 if self._continuation is None else self._continuation.lead

    def _time(self, stage: str) -> None:
        now = perf_counter()
        self.seconds[stage] = now - self._lap
        self._lap = now
