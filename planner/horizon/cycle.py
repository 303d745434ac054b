"""One cycle of the moving horizon at work: all candidates judged, the best finished, one chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from models.errors import ParameterError
from planner.horizon.answer import FULL_STOP, Answer, Deficit, Ranked, State, command_of
from planner.horizon.continuation import Driven, Points
from planner.horizon.cycle_planner import CyclePlanner, Work
from planner.horizon.path_projection import (
    PathProjection,
    cut,
    left_behind,
    locate,
    only,
    only_places,
)
from planner.horizon.previous_plan import PreviousPlanFollower, offered_path
from planner.horizon.refusals import malformed, out_of_reach
from planner.kernels.compiled import Bools, Floats
from planner.path import PathBatch, joined
from planner.pipeline.candidates import TimeOptimalBatch
from planner.plan import SpeedPlan, Status
from planner.verify.batch_judge import screen
from planner.verify.judge import Violations

_SAFE = (Status.OK, Status.BLOCKED)

_STARTS = 0.05
"""A plan that begins so much slower than the vehicle does not begin at the vehicle [m/s]."""


class Cycle:
    """One cycle: made, run once, thrown away."""

    def __init__(self, planner: CyclePlanner, state: State, driven: Driven | None) -> None:
        """Find the vehicle on the plan that it drives.

        Args:
            planner: of this cycle.
            state: of the vehicle; driven: what it drives, if anything.
        """
        self._planner, self._settings = planner, planner.equipment.settings
        self._state = state
        self._at = (state.x, state.y)
        self._lap = planner.begun
        self._gain = self._settings.switch_gain
        self.seconds: dict[str, float] = {}
        self._own: PreviousPlanFollower | None = None
        if driven is not None and not state.flaw():
            place = driven.locate(self._at, state.heading)
            if self._is_on(place) and self._tracks(driven, place):
                self._own = PreviousPlanFollower(planner, driven, place, None)

    def run(self, paths: PathBatch | None, clear: Floats) -> tuple[Answer, Driven | None]:
        """The answer, and the plan that is driven from now on.

        Args:
            paths: candidates, None if there is none; clear: (M,) free way on each of them [m].
        """
        if flaw := self._state.flaw():
            return Answer(Status.DEGRADED, f"{flaw}: full braking", None, FULL_STOP), None
        if paths is None:
            return self._stop("no candidate is offered", ())
        reasons = malformed(paths, clear)
        sound = np.flatnonzero([not why for why in reasons])
        place = None
        if len(sound) > 0:
            part = only(paths, sound) if len(sound) < len(reasons) else paths
            place = locate(part.x, part.y, part.count, self._at, self._state.heading)
            for j, why in zip(sound, out_of_reach(place, self._settings), strict=True):
                reasons[j] = why
        refused = tuple(
            Ranked(name, np.inf, False, why)
            for name, why in zip(paths.names, reasons, strict=True)
            if why
        )
        usable = np.flatnonzero([not why for why in reasons])
        if place is None or len(usable) == 0:
            return self._stop(f"no candidate can be driven: {refused[0].reason}", refused)
        if refused:
            place = only_places(place, np.searchsorted(sound, usable))
            paths, clear = only(paths, usable), clear[usable]
        return self._plan(paths, place, clear, refused)

    def _plan(
        self, paths: PathBatch, place: PathProjection, clear: Floats, refused: tuple[Ranked, ...]
    ) -> tuple[Answer, Driven | None]:
        """The answer where there are candidates to drive."""
        planner = self._planner
        begun = cut(paths, place, self._at)
        # Plans rest at stations: what a path costs jumps by the way from one to the next.
        step = float(np.hypot(np.diff(begun.x[1:3], axis=0), np.diff(begun.y[1:3], axis=0)).max())
        self._gain = self._settings.switch_gain + planner.equipment.planner.horizon_penalty * step
        left = left_behind(paths, place, planner.elevation_map)
        ours = self._find_own(paths, place, begun, left, clear)
        start = max(self._state.speed, 0.0)
        if self._own is not None:
            start, _ = self._own.driven.speed_at(self._own.place)
        way = None if self._own is None or ours is None else self._own.way_on()
        together, free, starts = begun, clear - left, np.full(len(clear), start)
        if way is not None:
            # One more candidate costs next to nothing, solved alone as much as twenty.
            together = joined(begun, way.path)
            free, starts = np.append(free, way.clear), np.append(starts, way.start)
        solved = planner.solve(together, free, starts)
        self._time("plan")
        worst = screen(
            solved.profile, solved.ground, solved.bounds, solved.speed_sq,
            planner.equipment.model, together.speed_limit,
        )[: len(clear)]  # fmt: skip
        self._time("judge")
        too_fast = (solved.reachable_start_sq < starts**2 - 1e-9)[: len(clear)]
        ranking, order = self._rank(begun.names, solved.cost[: len(clear)], worst, too_fast, ours)

        def begin(j: int) -> Driven:
            innocent = not worst[j].max() > 0.0
            return self._begin(solved, together, j, start, bool(too_fast[j]), innocent)

        def go_on() -> Driven | None:
            if self._own is None or way is None:
                return None
            return self._own.go_on(way, solved, together.speed_limit)

        own, deficit, kept = self._continue(None if ours is None else lambda: begin(ours), go_on)
        plans = [] if own is None else [own]
        # The plan driven so far and its best rival are finished whatever the time.
        rest = [j for j in order if j != ours]
        for n, j in enumerate(rest[: max(self._settings.smoothed - len(plans), 1)]):
            if n > 0 and planner.late():
                break
            plans.append(begin(j))
        self._time("smooth")
        name = "" if ours is None else begun.names[ours]
        plans.sort(key=lambda driven: self._key(driven, name))
        if own is not None and own.plan.status is Status.OK:
            # What reaches its end gives way only to what does so as well.
            plans.sort(key=lambda driven: driven.plan.status is not Status.OK)
        answer = self._answer(
            plans[0], tuple(driven.plan for driven in plans), (*ranking, *refused), deficit,
            kept and plans[0] is own,
        )  # fmt: skip
        self._time("choose")
        return answer

    # ------------------------------------------------------------------ candidates

    def _is_on(self, place: PathProjection) -> bool:
        """Is the vehicle on the plan driven so far?"""
        settings = self._settings
        beside, turned, along = (float(v[0]) for v in (place.beside, place.turned, place.along))
        return beside <= settings.beside and turned <= settings.turned and along >= -settings.ahead

    def _tracks(self, driven: Driven, place: PathProjection) -> bool:
        """Is the vehicle as fast as the plan has it, or about to be?"""
        planned, _ = driven.speed_at(place)
        return abs(max(self._state.speed, 0.0) - planned) <= self._settings.speed_error

    def _find_own(
        self, paths: PathBatch, place: PathProjection, begun: PathBatch, left: Floats, clear: Floats
    ) -> int | None:
        """Index of the candidate that is the path driven so far, which takes note of it."""
        own = self._own
        if own is None or own.driven.plan.candidate not in paths.names:
            return None
        j = paths.names.index(own.driven.plan.candidate)
        n = int(begun.count[j])
        x, y = begun.x[:n, j], begun.y[:n, j]
        if not own.driven.agrees(own.place, x, y, self._settings.same_path):
            return None
        alone = only(paths, np.array([j]))
        offered = offered_path(
            alone, int(place.segment[j]), self._planner.stations(alone), float(left[j]),
            float(clear[j]),
        )  # fmt: skip
        self._own = replace(own, offered=offered)
        return j

    def _rank(
        self, names: tuple[str, ...], cost: Floats, worst: Floats, too_fast: Bools, ours: int | None
    ) -> tuple[tuple[Ranked, ...], list[int]]:
        """All candidates by cost, those that the judge objects to last; and their indices."""
        invalid = (worst.max(axis=1) > 0.0) | too_fast
        own = np.arange(len(names)) == ours
        order: list[int] = np.lexsort((cost - self._gain * own, invalid)).tolist()
        costs, flawed = cost.tolist(), invalid.tolist()
        ranking = tuple(
            Ranked(
                names[j], costs[j], not flawed[j],
                _objection(worst[j], bool(too_fast[j])) if flawed[j] else "",
            )
            for j in order
        )  # fmt: skip
        return ranking, order

    # ------------------------------------------------------------------ plans

    def _continue(
        self, begin: Callable[[], Driven] | None, go_on: Callable[[], Driven | None]
    ) -> tuple[Driven | None, Deficit | None, bool]:
        """The plan driven so far in this cycle; what it lacks; is it kept as it was?

        Args:
            begin: makes the plan of the same path that begins anew at the vehicle, None if the path
                is not offered. go_on: makes the one that goes on from it, None if none does.
        """
        if self._own is None or begin is None:
            return None, None, False
        # At a crawl the next station is far away: what is free by now is not waited for.
        lingers = self._own.lingers
        new = begin() if lingers else go_on()
        enough = (Status.OK,) if self._own.driven.plan.status is Status.OK else _SAFE
        if lingers and new is not None and new.plan.status not in enough:
            new = go_on() or new
        if new is not None and new.plan.status in _SAFE:
            return new, None, False
        old, deficit = self._own.keep()
        if old is not None:
            return old, None, True
        return new or begin(), deficit, False

    def _begin(
        self, solved: TimeOptimalBatch, paths: PathBatch, j: int, start: float, too_fast: bool,
        innocent: bool,
    ) -> Driven:  # fmt: skip
        """The plan of a candidate that begins at the vehicle."""
        n, limit = int(paths.count[j]), paths.speed_limit
        accel = None
        if self._own is not None and start > 0.0:
            _, accel = self._own.driven.speed_at(self._own.place)
        speed_sq = np.ascontiguousarray(solved.speed_sq[:n, j])
        fixed_prefix = np.array([start**2])
        plan = self._planner.finish(
            paths.names[j], lambda: self._planner.finalizer(solved, j, fixed_prefix, limit),
            Work(speed_sq, not too_fast, innocent, accel),
        )  # fmt: skip
        return Driven(plan, None if limit is None else limit[:n, j], Points(*np.empty((2, 0))))

    def _key(self, driven: Driven, own: str) -> tuple[bool, bool, float]:
        """The smaller, the better: what is safe, as wanted, and soon there."""
        plan = driven.plan
        planner = self._planner.equipment.planner
        is_own = plan.candidate == own
        if plan.status is Status.INFEASIBLE:
            return True, not is_own, 0.0
        missed = float(plan.station[-1]) - plan.progress
        gone = 0.0
        if is_own:
            # It begins behind the vehicle.
            gone = driven.time_at(driven.locate(self._at, self._state.heading))
        cost = plan.travel_time - gone + planner.horizon_penalty * missed
        margin = min(plan.least_margin, planner.margin_enough)
        cost -= planner.margin_weight * max(margin, 0.0)
        cost -= self._gain * is_own
        return False, plan.status is Status.DEGRADED, cost

    def _stop(self, why: str, ranking: tuple[Ranked, ...]) -> tuple[Answer, Driven | None]:
        """No candidate: braking on the path driven so far, fully where that is not enough."""
        full = Answer(Status.DEGRADED, f"{why}: full braking", None, FULL_STOP, ranking=ranking)
        if self._own is None:
            return full, None
        stop = self._own.stop(why)
        return (full, None) if stop is None else self._answer(stop, (stop.plan,), ranking)

    def _answer(
        self, best: Driven, plans: tuple[SpeedPlan, ...], ranking: tuple[Ranked, ...],
        deficit: Deficit | None = None, kept: bool = False,
    ) -> tuple[Answer, Driven | None]:  # fmt: skip
        plan, speed = best.plan, max(self._state.speed, 0.0)
        place = best.locate(self._at, self._state.heading)
        reason = plan.reason
        if deficit is not None and plan.status not in _SAFE:
            reason = f"{reason}; the plan so far lacks {deficit.sentence()}"
        planned, _ = best.speed_at(place)
        if plan.status is Status.INFEASIBLE or speed - planned > max(
            _STARTS, self._settings.speed_error
        ):
            status = Status.INFEASIBLE
            return Answer(status, reason, plan, FULL_STOP, plans, ranking, deficit), None
        command = command_of(
            plan, best.station_at(place), best.time_at(place), self._settings.period
        )
        return Answer(plan.status, reason, plan, command, plans, ranking, deficit, kept), best

    def _time(self, stage: str) -> None:
        now = perf_counter()
        self.seconds[stage] = now - self._lap
        self._lap = now


def checked_clear(clear: float | Floats, candidates: int) -> Floats:
    """Clear distances of all candidates, (M,) [m].

    Raises:
        ParameterError: neither one number nor one for each candidate.
    """
    try:
        return np.broadcast_to(np.asarray(clear, np.float64), (candidates,))
    except ValueError:
        expected = f"one distance [m], or {candidates}, one for each candidate"
        raise ParameterError("clear", f"{expected}; got shape {np.shape(clear)}") from None


def _objection(worst: Floats, too_fast: bool) -> str:
    """What the judge objects to in a time-optimal profile."""
    if too_fast:
        return "starts faster than service braking can bring down"
    kind = int(np.argmax(worst))
    return f"{Violations._fields[kind]} by {worst[kind]:.3g}"
