"""The moving horizon: from state, candidates and map of this cycle to one plan and one command.

All candidates are planned and judged; the best are smoothed, as many as the time allows. The plan
that is being driven stays among them on stations of its own: as long as nothing got worse it may be
driven on, so an answer that was `ok` never turns into none (docs/decisions/0007-horizon.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from models.errors import ParameterError
from models.parameters import Model
from models.quantity import quantity, validate_quantities
from planner.answer import FULL_STOP, Answer, Command, Deficit, Ranked, State, command_of
from planner.candidates import TimeOptimalBatch, time_optimal_batch
from planner.check import Offence
from planner.compiled import Bools, Floats
from planner.continuation import Driven, Place, cut, locate, only
from planner.elevation_map import ElevationMap
from planner.emission import Emission, smoother_size
from planner.ground import Conditions
from planner.path import CandidatePath, PathBatch, batch
from planner.plan import SpeedPlan, Status
from planner.scalars import numbers
from planner.screening import screen
from planner.settings import PlannerSettings
from planner.smoothing import Smoother
from planner.uncertainty import Uncertainty

_FEWEST = 3
_INSIDE = 2
"""A station of a path that lies ahead of the vehicle for certain."""

_SAME = 1e-3
"""Stations as close as that are the same [m]."""

_SAFE = (Status.OK, Status.BLOCKED)


@dataclass(frozen=True, slots=True, kw_only=True)
class HorizonSettings:
    """How one cycle works, and when it changes its mind."""

    budget: float = quantity(
        "s", "Time for one cycle; what does not fit is smoothing.", default=0.02, above=0.0
    )
    smoothed: int = 4
    period: float = quantity("s", "From one cycle to the next.", default=0.1, above=0.0)
    switch_gain: float = quantity(
        "s", "By how much another candidate must be better to be chosen.", default=0.3, at_least=0.0
    )
    beside: float = quantity(
        "m", "Farthest that a path may lie beside the vehicle.", default=0.5, above=0.0
    )
    ahead: float = quantity(
        "m", "Farthest that a path may begin ahead of the vehicle.", default=1.0, above=0.0
    )
    turned: float = quantity(
        "rad", "Largest angle between a path and the heading.", default=1.0, above=0.0
    )
    same_path: float = quantity(
        "m", "How exactly a path of the same name is the same path.", default=0.1, above=0.0
    )
    speed_error: float = quantity(
        "m/s", "Difference to the planned speed that tracking removes.", default=0.1, at_least=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.smoothed < 1:
            raise ParameterError("smoothed", f"at least 1 candidate, got {self.smoothed}")


class Horizon:
    """Plans from cycle to cycle: one object a vehicle, one thread at a time."""

    def __init__(
        self,
        model: Model,
        settings: HorizonSettings | None = None,
        planner: PlannerSettings | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Begin without a plan.

        Args:
            model: of the vehicle.
            settings: of the cycle; planner: of planning.
            uncertainty: what plans have to survive.
        """
        self.settings = settings or HorizonSettings()
        self.planner = planner or PlannerSettings()
        self._driven: Driven | None = None
        self._smoothers: dict[str, _Remembering] = {}
        self.uncertainty = uncertainty or Uncertainty()
        self.learn(model)

    def learn(self, model: Model, uncertainty: Uncertainty | None = None) -> None:
        """Go on with other parameters, or with the same ones, aged."""
        self.uncertainty = uncertainty or self.uncertainty
        self.model = self.uncertainty.cautious(model)
        self._scalars = numbers(self.model)

    def forget(self) -> None:
        """Go on without the plan driven so far."""
        self._driven = None

    def step(
        self,
        state: State,
        paths: PathBatch | Sequence[CandidatePath],
        elevation_map: ElevationMap,
        *,
        clear: float | Floats = np.inf,
        conditions: Conditions | None = None,
    ) -> Answer:
        """One cycle.

        Args:
            state: of the vehicle now.
            paths: candidates, at best as stations that are even already. One that is called as the
                one that is driven, and runs along it, is the same path.
            elevation_map: ground as it is known now.
            clear: station up to which the way is known free, counted from the first point of each
                candidate; one for all, or (M,) [m].
            conditions: of the moment.

        Raises:
            ParameterError: a candidate is malformed.
        """
        begun = perf_counter()
        offered = None
        if isinstance(paths, PathBatch):
            offered = paths
        elif len(paths) > 0:
            offered = batch(list(paths), self.planner.spacing_on(elevation_map.resolution))
        count = len(offered.names) if offered is not None else 0
        free = np.broadcast_to(np.asarray(clear, np.float64), (count,)).copy()
        if np.isnan(free).any() or np.any(free < 0.0):
            raise ParameterError("clear", "distances >= 0 [m], one for all or for each candidate")
        cycle = _Cycle(self, state, elevation_map, conditions, begun)
        answer, driven = cycle.run(offered, free)
        self._driven = driven
        return replace(answer, seconds=cycle.seconds)

    def smoother(self, name: str, stations: int) -> _Remembering:
        """The candidate's own smoother, or one that remembers nothing yet."""
        size, known = smoother_size(stations), self._smoothers
        own = known.pop(name, None)
        if own is None or own.smoother.stations != size:
            spare = None
            if len(known) >= 2 * self.settings.smoothed:
                # The one that waited longest makes room.
                spare = known.pop(next(iter(known))).smoother
            fits = spare is not None and spare.stations == size
            own = _Remembering(spare if spare is not None and fits else Smoother(size))
        known[name] = own
        return own


@dataclass(slots=True)
class _Remembering:
    """A smoother, and the stations of the answer that it remembers; None if it has none."""

    smoother: Smoother
    stations: Floats | None = None

    def shift(self, x: Floats, y: Floats) -> int | None:
        """Stations from the answer that it remembers to a path that begins now.

        The same path goes on with the same stations, but for its first one, which is where the
        vehicle is; on another path, or on other stations, an answer is no help.
        """
        now = np.stack((x, y))
        before, self.stations = self.stations, now
        if before is None:
            return None
        off = np.hypot(*(before - now[:, _INSIDE, None]))
        m = int(np.argmin(off))
        return m - _INSIDE if off[m] < _SAME and m >= _INSIDE else None


class _Cycle:
    """One cycle at work."""

    def __init__(
        self, horizon: Horizon, state: State, elevation_map: ElevationMap,
        conditions: Conditions | None, begun: float,
    ) -> None:  # fmt: skip
        self._horizon, self._settings = horizon, horizon.settings
        self._state, self._map, self._conditions = state, elevation_map, conditions
        self._begun = self._lap = begun
        self.seconds: dict[str, float] = {}
        self._at = (state.x, state.y)
        self._driven: Driven | None = None
        self._place: Place | None = None
        if horizon._driven is not None and not state.flaw():
            place = horizon._driven.locate(self._at, state.heading)
            settings = self._settings
            if place.beside[0] <= settings.beside and place.turned[0] <= settings.turned:
                self._driven, self._place = horizon._driven, place

    def run(self, paths: PathBatch | None, clear: Floats) -> tuple[Answer, Driven | None]:
        """The answer, and the plan that is driven from now on."""
        if flaw := self._state.flaw():
            return Answer(Status.DEGRADED, f"{flaw}: full braking", None, FULL_STOP), None
        if paths is None:
            return self._stop_along("no candidate is offered", ())
        place = locate(paths.x, paths.y, paths.count, self._at, self._state.heading)
        reasons = [self._refusal(place, j, int(n)) for j, n in enumerate(paths.count)]
        refused = tuple(
            Ranked(name, np.inf, False, why)
            for name, why in zip(paths.names, reasons, strict=True)
            if why
        )
        if refused:
            usable = np.flatnonzero([not why for why in reasons])
            if len(usable) == 0:
                why = f"no candidate can be driven from here: {refused[0].reason}"
                return self._stop_along(why, refused)
            paths, place, clear = *only(paths, place, usable), clear[usable]
        begun, left = cut(paths, place, self._at)
        start = self._start_speed()
        solved = self._solve(begun, clear - left, start)
        self._time("plan")
        worst = screen(
            solved.profile, solved.ground, solved.bounds, solved.speed_sq, self._horizon.model,
            begun.speed_limit,
        )  # fmt: skip
        self._time("judge")
        too_fast = solved.reachable_start_sq < start**2 - 1e-9
        ours = self._ours(paths)
        ranking, order = self._rank(begun.names, solved.cost, worst, too_fast, ours)
        plans: list[Driven] = []
        for j in order[: self._settings.smoothed]:
            if plans and self._is_late():
                break
            plan = self._go_on(paths, j, clear[j] - left[j]) if j == ours else None
            innocent = not worst[j].max() > 0.0
            plans.append(plan or self._begin(solved, begun, j, start, bool(too_fast[j]), innocent))
        self._time("smooth")
        own_clear = None if ours is None else float(clear[ours] - left[ours])
        return self._choose(plans, (*ranking, *refused), own_clear)

    # ------------------------------------------------------------------ candidates

    def _refusal(self, place: Place, j: int, count: int) -> str:
        """Why a candidate cannot be driven from here, empty if it can."""
        beside, gap, turned = place.beside[j], -place.along[j], place.turned[j]
        settings = self._settings
        if beside > settings.beside:
            return f"the path lies {beside:.2f} m beside the vehicle, {settings.beside:g} m at most"
        if gap > settings.ahead:
            return f"the path begins {gap:.2f} m ahead of the vehicle, {settings.ahead:g} m at most"
        if turned > settings.turned:
            most = np.rad2deg(settings.turned)
            return f"the path points {np.rad2deg(turned):.0f}° off the heading, {most:.0f}° at most"
        return "" if count >= _FEWEST else f"the path has {count} stations, {_FEWEST} at least"

    def _start_speed(self) -> float:
        """The planned speed as long as tracking is trusted, else the measured one [m/s]."""
        measured = max(self._state.speed, 0.0)
        if self._driven is None or self._place is None:
            return measured
        planned, _ = self._driven.speed_at(self._place)
        return planned if abs(measured - planned) <= self._settings.speed_error else measured

    def _ours(self, paths: PathBatch) -> int | None:
        """Index of the candidate that is the path driven so far."""
        if self._driven is None or self._driven.plan.candidate not in paths.names:
            return None
        j = paths.names.index(self._driven.plan.candidate)
        n = int(paths.count[j])
        same = self._driven.agrees(paths.x[:n, j], paths.y[:n, j], self._settings.same_path)
        return j if same else None

    def _solve(self, paths: PathBatch, clear: Floats, start: float) -> TimeOptimalBatch:
        horizon = self._horizon
        return time_optimal_batch(
            self._map, paths.x, paths.y, paths.count, horizon.model, start_speed=start,
            clear=np.maximum(clear, 0.0), speed_limit=paths.speed_limit, settings=horizon.planner,
            conditions=self._conditions, uncertainty=horizon.uncertainty,
        )  # fmt: skip

    def _rank(
        self, names: tuple[str, ...], cost: Floats, worst: Floats, too_fast: Bools, ours: int | None
    ) -> tuple[tuple[Ranked, ...], list[int]]:
        """All candidates by cost, those that the judge objects to last; and what to finish."""
        invalid = (worst.max(axis=1) > 0.0) | too_fast
        own = np.arange(len(names)) == ours
        order = np.lexsort((cost - self._settings.switch_gain * own, invalid))
        ranking = tuple(
            Ranked(
                names[j], float(cost[j]), not invalid[j], _objection(worst[j], bool(too_fast[j]))
            )
            for j in order
        )
        first = [] if ours is None else [ours]
        return ranking, first + [int(j) for j in order if j != ours]

    # ------------------------------------------------------------------ plans

    def _begin(
        self,
        solved: TimeOptimalBatch,
        paths: PathBatch,
        j: int,
        start: float,
        too_fast: bool,
        innocent: bool,
    ) -> Driven:
        """The plan of a candidate that begins at the vehicle."""
        n, limit = int(paths.count[j]), paths.speed_limit
        emission = self._emission(solved, j, np.array([start**2]), limit)
        accel = None
        if self._driven is not None and self._place is not None and start > 0.0:
            _, accel = self._driven.speed_at(self._place)
        smoother, shift, late = self._smoother(paths.names[j], paths.x[:n, j], paths.y[:n, j])
        plan = emission.emit(
            paths.names[j], np.ascontiguousarray(solved.speed_sq[:n, j]), smoother,
            reachable=not too_fast, innocent=innocent, start_accel=accel, shift=shift,
            unsmoothed=late,
        )  # fmt: skip
        return Driven(plan, None if limit is None else limit[:n, j])

    def _go_on(self, paths: PathBatch, j: int, clear: float) -> Driven | None:
        """The plan of the path that is driven, on its stations; None if it has to begin anew."""
        driven, place = self._driven, self._place
        assert driven is not None
        assert place is not None
        i, plan = int(place.segment[0]), driven.plan
        if not self._tracks() or plan.speed[i + 1] <= 0.0:
            return None
        n = int(paths.count[j])
        limit = None if paths.speed_limit is None else paths.speed_limit[:n, j]
        path, behind = driven.going_on(place, paths.x[:n, j], paths.y[:n, j], limit)
        emission = self._on_own_stations(path, behind, clear)
        speed_sq, reachable = emission.fastest()
        if not reachable:
            return None
        first = i - behind
        smoother, shift, late = self._smoother(
            plan.candidate, path.x[first + 1 :, 0], path.y[first + 1 :, 0]
        )
        answer = emission.emit(
            plan.candidate, speed_sq, smoother, innocent=True, start_accel=float(plan.accel[i]),
            shift=shift, unsmoothed=late,
        )  # fmt: skip
        return Driven(answer, None if path.speed_limit is None else path.speed_limit[first:, 0])

    def _on_own_stations(self, path: PathBatch, behind: int, clear: float) -> Emission:
        """The driven path from the segment on in which the vehicle is.

        Args:
            path: its stations from ``behind`` on. clear: free way from the vehicle on [m].
        """
        driven, place = self._driven, self._place
        assert driven is not None
        assert place is not None
        i, plan = int(place.segment[0]), driven.plan
        free = clear + driven.station_at(place) - float(plan.station[behind])
        solved = self._solve(path, np.array([free]), float(plan.speed[behind]))
        lead = plan.speed[i : i + 2] ** 2
        return self._emission(solved, 0, lead, path.speed_limit, i - behind)

    def _emission(
        self, solved: TimeOptimalBatch, j: int, lead: Floats, limit: Floats | None, first: int = 0
    ) -> Emission:
        horizon = self._horizon
        return Emission(
            horizon.model, horizon._scalars, solved.profile, solved.ground, solved.bounds, j, lead,
            speed_limit=limit, first=first,
        )  # fmt: skip

    def _smoother(self, name: str, x: Floats, y: Floats) -> tuple[Smoother | None, int | None, str]:
        """Smoother, stations since its last answer, and why there is none though wanted."""
        if not self._horizon.planner.smooth:
            return None, None, ""
        if self._is_late():
            return None, None, f"not smoothed within {1e3 * self._settings.budget:.0f} ms"
        own = self._horizon.smoother(name, len(x))
        return own.smoother, own.shift(x, y), ""

    # ------------------------------------------------------------------ what is driven

    def _tracks(self) -> bool:
        """Is the vehicle as fast as the plan has it?"""
        assert self._driven is not None
        assert self._place is not None
        planned, _ = self._driven.speed_at(self._place)
        return abs(max(self._state.speed, 0.0) - planned) <= self._settings.speed_error

    def _choose(
        self, plans: list[Driven], ranking: tuple[Ranked, ...], own_clear: float | None
    ) -> tuple[Answer, Driven | None]:
        """The best plan; the one driven so far where only that is as it should be."""
        own = "" if self._driven is None or own_clear is None else self._driven.plan.candidate
        plans = sorted(plans, key=lambda driven: self._key(driven.plan, own))
        best, deficit, kept = plans[0], None, False
        if best.plan.status not in _SAFE and own_clear is not None and self._tracks():
            rest, deficit = self._keep(own_clear)
            if rest is not None and (
                rest.plan.status in _SAFE or best.plan.status is Status.INFEASIBLE
            ):
                best, kept = rest, True
        self._time("choose")
        finished = tuple(driven.plan for driven in plans)
        return self._answer(best, finished, ranking, deficit, kept)

    def _key(self, plan: SpeedPlan, own: str) -> tuple[bool, bool, float]:
        settings = self._horizon.planner
        missed = float(plan.station[-1]) - plan.progress
        cost = plan.travel_time + settings.horizon_penalty * missed
        margin = min(plan.least_margin, settings.margin_enough)
        cost -= settings.margin_weight * max(margin, 0.0)
        cost -= self._settings.switch_gain * (plan.candidate == own)
        fallback = plan.status is Status.DEGRADED
        return plan.status is Status.INFEASIBLE, fallback, cost

    def _keep(self, clear: float) -> tuple[Driven | None, Deficit | None]:
        """What is left of the plan driven so far, and what it lacks by what is known now."""
        driven, place = self._driven, self._place
        assert driven is not None
        assert place is not None
        i = int(place.segment[0])
        path, behind = driven.rest(place)
        emission = self._on_own_stations(path, behind, clear)
        speed_sq = driven.plan.speed[i:] ** 2
        plan = emission.keep(driven.plan.candidate, speed_sq)
        if plan is not None:
            limit = None if driven.speed_limit is None else driven.speed_limit[i:]
            return Driven(plan, limit), None
        verdict = emission.judge(speed_sq)
        kind = int(np.argmax(verdict.offence))
        k = int(verdict.where[0]) if len(verdict.where) else 0
        distance = float(driven.plan.station[i + k]) - driven.station_at(place)
        return None, Deficit(
            float(verdict.offence[kind]), max(distance, 0.0), Offence._fields[kind]
        )

    def _stop_along(self, why: str, ranking: tuple[Ranked, ...]) -> tuple[Answer, Driven | None]:
        """Service braking on the path driven so far; full braking where that is not enough."""
        driven, place = self._driven, self._place
        full = Answer(Status.DEGRADED, f"{why}: full braking", None, FULL_STOP, ranking=ranking)
        if driven is None or place is None or self._state.speed <= 0.0:
            return full, None
        i, plan = int(place.segment[0]), driven.plan
        if not self._tracks():
            return full, None
        path, behind = driven.rest(place)
        emission = self._on_own_stations(path, behind, plan.clear_distance)
        station = plan.station[i:]
        decel = self._horizon.model.limits.decel
        slowing = plan.speed[i + 1] ** 2 - 2.0 * decel * (station - station[1])
        speed_sq = np.minimum(plan.speed[i:] ** 2, np.maximum(slowing, 0.0))
        speed_sq[:2] = plan.speed[i : i + 2] ** 2
        stop = emission.keep(plan.candidate, speed_sq)
        if stop is None:
            return full, None
        reason = f"{why}: stops on the path driven so far"
        stop = replace(stop, status=Status.DEGRADED, reason=reason)
        limit = None if driven.speed_limit is None else driven.speed_limit[i:]
        return self._answer(Driven(stop, limit), (stop,), ranking, None, False)

    def _answer(
        self, best: Driven, plans: tuple[SpeedPlan, ...], ranking: tuple[Ranked, ...],
        deficit: Deficit | None, kept: bool,
    ) -> tuple[Answer, Driven | None]:  # fmt: skip
        plan = best.plan
        station = best.station_at(best.locate(self._at, self._state.heading))
        command: Command = command_of(plan, station, self._settings.period)
        reason = plan.reason
        if deficit is not None and plan.status not in _SAFE:
            reason = f"{reason}; the plan so far lacks {deficit.sentence()}"
        answer = Answer(plan.status, reason, plan, command, plans, ranking, deficit, kept)
        return answer, best if plan.status is not Status.INFEASIBLE else None

    # ------------------------------------------------------------------ time

    def _is_late(self) -> bool:
        return perf_counter() - self._begun > self._settings.budget

    def _time(self, stage: str) -> None:
        now = perf_counter()
        self.seconds[stage] = now - self._lap
        self._lap = now


def _objection(worst: Floats, too_fast: bool) -> str:
    """What the judge objects to in a time-optimal profile, empty if nothing."""
    if too_fast:
        return "starts faster than service braking can bring down"
    if not worst.max() > 0.0:
        return ""
    kind = int(np.argmax(worst))
    return f"{Offence._fields[kind]} by {worst[kind]:.3g}"
