"""Answers questions for plans; knows nothing of the wire they came on.

A named client has a moving horizon of its own; a question without a name stands alone. One
candidate that cannot be used is refused with a reason, the others are planned.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from slopewise.models.errors import InputError, ParameterError
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import FULL_STOP, PlanarState, SpeedCommand, command_of
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank, ranking_cost
from slopewise.planner.plan import Obstacle, SpeedPlan, Status
from slopewise.services.parameters.in_use import ParametersInUse
from slopewise.services.planning.map_store import KnownGround
from slopewise.services.planning.pace import Costs, Pace, unhurried
from slopewise.services.planning.plan_questions import (
    Usable,
    at_the_vehicle,
    check,
    resampled,
    usable_of,
)
from slopewise.services.planning.stale_map import MapAge
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import messages
from slopewise.services.wire.messages import (
    Deviation,
    Limit,
    Met,
    Plan,
    PlanReply,
    PlanRequest,
    RankedCandidate,
    WireCommand,
)

_AT_ONCE = 64
"""Candidates between which a question can be left no more than a few milliseconds apart."""

_GONE_AFTER = 10.0


class _Client:
    """A client's horizon; one question at a time."""

    def __init__(self, horizon: Horizon, parameters: ParametersInUse) -> None:
        self.lock = threading.Lock()
        self.asked, self.heard = 0, time.monotonic()
        self.horizon = horizon
        self.identity = parameters.identity


class PlanService:
    """Plans for many clients with one model; may be asked from several threads."""

    def __init__(self, config: ServiceConfig, parameters: ParametersInUse) -> None:
        """Plan with these parameters until :meth:`learn` brings others."""
        self.config = config
        self.parameters = parameters
        self._uncertainty = config.planning.uncertainty()
        self._clients: OrderedDict[str, _Client] = OrderedDict()
        self._lock = threading.Lock()
        self._costs = Costs()
        self._newest: tuple[tuple[int, int], CandidatePlanner] | None = None

    def learn(self, parameters: ParametersInUse) -> None:
        """Plan with other parameters from the next question on."""
        self.parameters = parameters

    def forget(self, client: str) -> None:
        """A client did not get its answer: it does not drive what was planned for it."""
        with self._lock:
            known = self._clients.get(client)
        if known is not None:
            with known.lock:
                known.horizon.forget()

    def drop(self, client: str) -> None:
        """Know nothing of a client any more."""
        with self._lock:
            self._clients.pop(client, None)

    def answer(
        self,
        request: PlanRequest,
        ground: KnownGround | None,
        source: str,
        *,
        pace: Pace = unhurried,
        left: float = np.inf,
    ) -> PlanReply:
        """The answer to one question.

        Args:
            request: as it came. ground: as it is known now. source: key, for errors.
            pace: called between candidates. left: time to the deadline [s].

        Raises:
            InputError: the question as a whole cannot be used.
            TooLateError: it cannot be answered in time.
        """
        begun = time.perf_counter()
        check(request, self.config.sizes, source)
        parameters = self.parameters
        if ground is None:
            return self._reply(request, parameters, None, "no map has come yet: full braking")
        map_age = self._map_age(ground)
        if map_age.ends:
            # What is driven was planned on this map as well.
            self.forget(request.client)
            reason = f"{map_age.reasons()[0]}: full braking"
            return self._reply(request, parameters, ground, reason)
        spacing = self.config.planning.planner().spacing_on(ground.elevation_map.resolution)
        usable, refused = usable_of(request, self.config.sizes, spacing, source)
        checked = time.perf_counter()
        named = bool(request.client)
        self._costs.check(len(usable), left, named=named)
        even, flawed = resampled(usable, spacing, parameters.model.max_path_deviation, pace)
        even = map_age.slowed(even)
        try:
            if named:
                reply = self._go_on(request, parameters, ground, even)
            else:
                reply = self._stand_alone(request, parameters, ground, even, pace)
        except ParameterError as error:
            raise InputError(source, error.field, f"expected {error.expected}") from None
        refused += flawed
        self._costs.learn(len(usable), time.perf_counter() - checked, named=named)
        seconds = {
            **reply.seconds,
            "check": checked - begun,
            "planner": time.perf_counter() - checked,
        }
        return _with(reply, ranking=[*reply.ranking, *refused], seconds=seconds)

    # ------------------------------------------------------------------ planning

    def _go_on(
        self,
        request: PlanRequest,
        parameters: ParametersInUse,
        ground: KnownGround,
        usable: list[Usable],
    ) -> PlanReply:
        assert request.pose is not None
        x, y, heading = request.pose
        state = PlanarState(x=x, y=y, heading=heading, speed=request.speed)
        client = self._client(request.client, parameters)
        with client.lock:
            if client.identity != parameters.identity:
                client.horizon.learn(parameters.model, self._survives(parameters))
                client.identity = parameters.identity
            answer = client.horizon.step(
                state,
                [u.path for u in usable],
                ground.elevation_map,
                clear=np.array([u.clear for u in usable]) if usable else np.inf,
                conditions=_conditions(request),
            )
        ranking = [
            RankedCandidate(name=r.candidate, usable=r.valid, reason=r.reason, cost=_finite(r.cost))
            for r in answer.ranking
        ]
        reply = self._reply(
            request,
            parameters,
            ground,
            answer.reason,
            answer.status,
            answer.command,
            answer.chosen,
            answer.plans,
        )
        stages = {f"planner.{stage}": s for stage, s in answer.seconds.items()}
        return _with(reply, ranking=ranking, kept=answer.kept, seconds=stages)

    def _client(self, name: str, parameters: ParametersInUse) -> _Client:
        with self._lock:
            known = self._clients.pop(name, None)
            if known is None:
                planning = self.config.planning
                horizon = Horizon(
                    parameters.model,
                    planning.horizon(),
                    planning.planner(),
                    self._survives(parameters),
                )
                known = _Client(horizon, parameters)
            known.asked, known.heard = known.asked + 1, time.monotonic()
            self._clients[name] = known
            while len(self._clients) > self.config.planning.clients:
                self._clients.pop(self._least_missed())
            return known

    def _least_missed(self) -> str:
        """Who makes room: who was not heard for long, else who asked the least.

        Names that are invented for one question do not drive out a client that drives.
        """
        oldest, client = next(iter(self._clients.items()))
        if time.monotonic() - client.heard > _GONE_AFTER:
            return oldest
        return min(self._clients, key=lambda name: self._clients[name].asked)

    def _stand_alone(
        self,
        request: PlanRequest,
        parameters: ParametersInUse,
        ground: KnownGround,
        usable: list[Usable],
        pace: Pace,
    ) -> PlanReply:
        track = parameters.model.vehicle.track_width
        reach = self.config.planning.horizon().for_track(track)
        usable, refused = at_the_vehicle(request, usable, reach)
        if not usable:
            detail = f": {refused[0].reason}" if refused else ""
            reason = f"no candidate is usable{detail}: full braking"
            return _with(self._reply(request, parameters, ground, reason), ranking=refused)
        planner = self._planner(parameters)
        # Of plans as good as each other the one with the shorter clear distance comes first.
        usable = sorted(usable, key=lambda one: one.clear)
        plans: list[SpeedPlan] = []
        for first in range(0, len(usable), _AT_ONCE):
            part = usable[first : first + _AT_ONCE]
            plans += planner.plan(
                ground.elevation_map,
                [u.path for u in part],
                start_speed=request.speed,
                clear=np.array([u.clear for u in part]),
                conditions=_conditions(request),
                progress=lambda _: pace(),
            )
        settings = self.config.planning.planner()
        plans = rank(plans, settings)
        best = plans[0]
        ranking = [
            RankedCandidate(
                name=p.candidate,
                usable=p.status is not Status.INFEASIBLE,
                reason=p.reason,
                cost=ranking_cost(p, settings),
            )
            for p in plans
        ]
        command = FULL_STOP
        if best.status is not Status.INFEASIBLE:
            command = command_of(best, 0.0, 0.0, self.config.planning.period)
        reply = self._reply(
            request, parameters, ground, best.reason, best.status, command, best, plans
        )
        return _with(reply, ranking=[*ranking, *refused])

    def _planner(self, parameters: ParametersInUse) -> CandidatePlanner:
        """The planner with these parameters; replaced as a whole, so that threads need no lock."""
        newest = self._newest
        if newest is None or newest[0] != parameters.identity:
            settings, survives = self.config.planning.planner(), self._survives(parameters)
            planner = CandidatePlanner(parameters.model, settings, survives)
            newest = self._newest = (parameters.identity, planner)
        return newest[1]

    def _survives(self, parameters: ParametersInUse) -> Uncertainty:
        return parameters.uncertainty or self._uncertainty

    # ------------------------------------------------------------------ answers

    def _reply(
        self,
        request: PlanRequest,
        parameters: ParametersInUse,
        ground: KnownGround | None,
        reason: str,
        status: Status = Status.DEGRADED,
        command: SpeedCommand = FULL_STOP,
        chosen: SpeedPlan | None = None,
        plans: Sequence[SpeedPlan] = (),
    ) -> PlanReply:
        return PlanReply(
            status=status.value,
            reason=reason,
            service=self.config.id,
            sequence=request.sequence,
            parameters=parameters.message(),
            map_version=0 if ground is None else ground.version,
            map_age=None if ground is None else ground.age(),
            map_id="" if ground is None else ground.id,
            map_hash="" if ground is None else ground.digest,
            command=WireCommand(
                speed=command.speed,
                accel=command.accel,
                stop=command.stop,
                valid_for=command.valid_for,
            ),
            chosen=None if chosen is None else chosen.candidate,
            plans=[_plan(plan) for plan in plans],
            flags=[*parameters.flags, *self.flags(ground)],
        )

    def flags(self, ground: KnownGround | None) -> list[str]:
        """What is not as it should be."""
        if ground is None:
            return ["no map"]
        old = ground.age() > self.config.status.map_age
        late = [f"degraded: {reason}" for reason in self.degraded(ground)]
        flags = ["map is old"] if old else []
        flags += ["map updates were lost"] if ground.incomplete else []
        return [*late, *flags, *ground.flags()]

    def degraded(self, ground: KnownGround | None) -> list[str]:
        """Reasons in the map for slower plans."""
        return [] if ground is None else self._map_age(ground).reasons()

    def _map_age(self, ground: KnownGround) -> MapAge:
        limit = self.parameters.model.limits.speed
        return MapAge.of(ground, self.config.planning.max_map_age, limit)


def _conditions(request: PlanRequest) -> GroundConditions:
    return GroundConditions(session_time=request.session_time, brake_heat=request.brake_heat)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _plan(plan: SpeedPlan) -> Plan:
    changes = np.flatnonzero(np.diff(plan.limiting)) + 1
    firsts = [0, *(int(i) for i in changes)]
    return Plan(
        candidate=plan.candidate,
        status=plan.status.value,
        reason=plan.reason,
        travel_time=plan.travel_time,
        progress=plan.progress,
        clear_distance=float(plan.clear_distance),
        least_margin=_finite(plan.least_margin),
        least_rear_load=float(plan.rear_load.min()),
        limits=[Limit(first=i, name=Limiting(int(plan.limiting[i])).label) for i in firsts],
        columns=list(messages.PLAN_COLUMNS),
        values=np.stack([getattr(plan, name) for name in messages.PLAN_COLUMNS]),
        obstacle=_met(plan.obstacle),
        path_deviation=_deviation(plan),
    )


def _deviation(plan: SpeedPlan) -> Deviation | None:
    deviation = plan.path_deviation
    if deviation is None:
        return None
    return Deviation(
        largest=deviation.largest,
        station=deviation.station,
        x=deviation.x,
        y=deviation.y,
        limit=deviation.limit,
    )


def _met(obstacle: Obstacle | None) -> Met | None:
    if obstacle is None:
        return None
    return Met(
        bound=obstacle.bound.label,
        x=float(obstacle.x),
        y=float(obstacle.y),
        height=float(obstacle.height),
        words=obstacle.words,
    )


def _with(reply: PlanReply, **changes: object) -> PlanReply:
    fields = {name: getattr(reply, name) for name in reply.__struct_fields__}
    return PlanReply(**(fields | changes))
