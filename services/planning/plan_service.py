"""Answers to plan requests; independent of the wire on which they arrive.

A named client has its own moving horizon; a request without a name is planned once. One candidate
that is not usable is rejected with a reason, and the remaining ones are planned.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import dataclass
from functools import partial

import numpy as np
from msgspec import structs

from slopewise.models.smallest_seen import hides_steps, sight_notes
from slopewise.planner.followed_line import line_limits
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.horizon.path_projection import departure_of
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.files import faults_of
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.deadline_check import CostEstimator, DeadlineCheck, no_deadline
from slopewise.services.planning.map_age import MapAge
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.planning.plan_reply import cycle_reply, full_stop, ranked_reply
from slopewise.services.planning.request_validation import (
    PlanCandidate,
    resample_all,
    select_at_vehicle,
    validate_candidates,
)
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest, RankedCandidate

_BATCH_SIZE = 64
"""Candidates planned together [1]; a request can be interrupted between batches only."""

_INACTIVE_AFTER = 10.0
"""Time without a request after which a client may be dropped for a new one [s]."""


@dataclass(frozen=True, slots=True)
class _Job:
    """A request, with the parameters and the map that were in use when its turn came."""

    request: PlanRequest
    parameters: ActiveParameters
    snapshot: MapSnapshot

    @property
    def conditions(self) -> GroundConditions:
        request = self.request
        return GroundConditions(request.session_time, request.brake_heat, request.pose_age)

    @property
    def state(self) -> PlanarState | None:
        """Of the vehicle, None where the request has no pose."""
        if self.request.pose is None:
            return None
        x, y, heading = self.request.pose
        age = self.request.pose_age
        return PlanarState(x=x, y=y, heading=heading, speed=self.request.speed, age=age)


class _Client:
    """A client's horizon; one request at a time."""

    def __init__(self, horizon: Horizon, parameters: ActiveParameters) -> None:
        self.lock = threading.Lock()
        self.request_count, self.last_request = 0, time.monotonic()
        self.horizon = horizon
        self.identity = parameters.identity


class PlanService:
    """Plans for many clients with one model; may be called from several threads."""

    def __init__(self, config: ServiceConfig, parameters: ActiveParameters) -> None:
        """Plan with these parameters until :meth:`learn` replaces them."""
        self.config = config
        self.parameters = parameters
        self.notices: list[str] = []  # about the service, as flags of every reply
        self._uncertainty = config.planning.uncertainty()
        self._clients: OrderedDict[str, _Client] = OrderedDict()
        self._lock = threading.Lock()
        self._costs = CostEstimator()
        self._newest: tuple[tuple[int, int], CandidatePlanner] | None = None

    def learn(self, parameters: ActiveParameters) -> None:
        """Plan with other parameters from the next request on."""
        self.parameters = parameters

    def forget(self, client: str) -> None:
        """Forget the plan of a client that did not receive it."""
        with self._lock:
            known = self._clients.get(client)
        if known is not None:
            with known.lock:
                known.horizon.forget()

    def answer(
        self,
        request: PlanRequest,
        snapshot: MapSnapshot | None,
        key: str,
        *,
        check_deadline: DeadlineCheck = no_deadline,
        remaining: float = np.inf,
    ) -> PlanReply:
        """Reply to a valid request; errors name ``key``; ``remaining``: until the deadline [s]."""
        started = time.perf_counter()
        parameters = self.parameters
        if snapshot is None:
            result = full_stop("no map has come yet: full braking")
            return self._reply(request, parameters, None, result)
        map_age = self._map_age(snapshot)
        if map_age.is_too_old:
            # The plan being driven was made on this map as well.
            self.forget(request.client)
            result = full_stop(f"{map_age.reasons()[0]}: full braking")
            return self._reply(request, parameters, snapshot, result)
        job = _Job(request, parameters, snapshot)
        resolution, vehicle = snapshot.elevation_map.resolution, parameters.model.vehicle
        spacing = self.config.planning.planner().spacing_on(resolution, vehicle)
        valid = validate_candidates(request, self.config.sizes, spacing, key)
        checked = time.perf_counter()
        count, is_named = len(valid.candidates), bool(request.client)
        self._costs.check(count, remaining, named=is_named)
        limits = line_limits(parameters.model)
        even = resample_all(valid.candidates, spacing, limits, check_deadline)
        candidates = map_age.limit_speed(even.candidates)
        rejected = [*valid.rejected, *even.rejected]
        with faults_of(key):
            if request.client:
                result = self._plan_for_client(job, candidates)
            else:
                result = self._plan_once(job, candidates, rejected, check_deadline)
        duration = time.perf_counter() - checked
        self._costs.record(count, duration, named=is_named)
        seconds = {"check": checked - started, "planner": duration}
        return self._reply(request, parameters, snapshot, result, rejected, seconds)

    # ------------------------------------------------------------------ planning

    def _plan_for_client(self, job: _Job, candidates: list[PlanCandidate]) -> PlanReply:
        request, parameters, state = job.request, job.parameters, job.state
        assert state is not None
        client = self._client(request.client, parameters)
        with client.lock:
            if client.identity != parameters.identity:
                client.horizon.learn(parameters.model, self._margins(parameters))
                client.identity = parameters.identity
            answer = client.horizon.step(
                state,
                [c.path for c in candidates],
                job.snapshot.elevation_map,
                clear=np.array([c.clear for c in candidates]) if candidates else np.inf,
                conditions=job.conditions,
            )
        return cycle_reply(answer)

    def _client(self, name: str, parameters: ActiveParameters) -> _Client:
        with self._lock:
            client = self._clients.pop(name, None)
            if client is None:
                planning = self.config.planning
                horizon = Horizon(
                    parameters.model,
                    planning.horizon(),
                    planning.planner(),
                    self._margins(parameters),
                )
                client = _Client(horizon, parameters)
            client.request_count, client.last_request = client.request_count + 1, time.monotonic()
            self._clients[name] = client
            while len(self._clients) > self.config.planning.clients:
                self._clients.pop(self._client_to_evict())
            return client

    def _client_to_evict(self) -> str:
        """An inactive client, else the one with the fewest requests.

        Names that are used for one request do not displace a client that drives.
        """
        oldest, client = next(iter(self._clients.items()))
        if time.monotonic() - client.last_request > _INACTIVE_AFTER:
            return oldest
        return min(self._clients, key=lambda name: self._clients[name].request_count)

    def _plan_once(
        self,
        job: _Job,
        candidates: list[PlanCandidate],
        unusable: list[RankedCandidate],
        check_deadline: DeadlineCheck,
    ) -> PlanReply:
        planning, model = self.config.planning, job.parameters.model
        limits = planning.horizon().for_track(model.vehicle.track_width)
        at_vehicle = select_at_vehicle(job.request, candidates, limits)
        rejected = at_vehicle.rejected
        if not at_vehicle.candidates:
            reasons = [candidate.reason for candidate in (*rejected, *unusable)]
            detail = reasons[0] if reasons else "paths is empty"
            return full_stop(f"no candidate is usable: {detail}: full braking", rejected)
        planner, state = self._planner(job.parameters), job.state
        plans: list[SpeedPlan] = []
        # Of plans with equal cost the one with the shorter clear distance comes first.
        ordered = sorted(at_vehicle.candidates, key=lambda c: c.clear)
        for first in range(0, len(ordered), _BATCH_SIZE):
            part = ordered[first : first + _BATCH_SIZE]
            plans += planner.plan(
                job.snapshot.elevation_map,
                [c.path for c in part],
                start_speed=job.request.speed,
                clear=np.array([c.clear for c in part]),
                conditions=job.conditions,
                departs=None if state is None else partial(departure_of, state=state),
                progress=lambda _: check_deadline(),
            )
        settings = planning.planner()
        return ranked_reply(rank(plans, settings), settings, planning.period, rejected)

    def _planner(self, parameters: ActiveParameters) -> CandidatePlanner:
        """Planner with these parameters; replaced as a whole, so that threads need no lock."""
        newest = self._newest
        if newest is None or newest[0] != parameters.identity:
            settings, margins = self.config.planning.planner(), self._margins(parameters)
            planner = CandidatePlanner(parameters.model, settings, margins)
            newest = self._newest = (parameters.identity, planner)
        return newest[1]

    def _margins(self, parameters: ActiveParameters) -> Uncertainty:
        return parameters.uncertainty or self._uncertainty

    # ------------------------------------------------------------------ replies

    def _reply(
        self,
        request: PlanRequest,
        parameters: ActiveParameters,
        snapshot: MapSnapshot | None,
        result: PlanReply,
        rejected: list[RankedCandidate] | None = None,
        seconds: dict[str, float] | None = None,
    ) -> PlanReply:
        return structs.replace(
            result,
            service=self.config.id,
            sequence=request.sequence,
            parameters=parameters.message(),
            map_version=0 if snapshot is None else snapshot.version,
            map_age=None if snapshot is None else snapshot.age(),
            map_id="" if snapshot is None else snapshot.id,
            map_hash="" if snapshot is None else snapshot.digest,
            ranking=[*result.ranking, *(rejected or [])],
            flags=[*self.notices, *parameters.flags, *self.warnings(snapshot)],
            seconds=result.seconds | (seconds or {}),
        )

    def warnings(self, snapshot: MapSnapshot | None) -> list[str]:
        """Warnings about the map in use."""
        if snapshot is None:
            return ["no map"]
        is_old = not snapshot.fixed and snapshot.age() > self.config.status.map_age
        return [
            *(f"degraded: {reason}" for reason in self.degraded(snapshot)),
            *(["map is old"] if is_old else []),
            *(["map updates were lost"] if snapshot.incomplete else []),
            *(f"map: {note}" for note in self._unseen(snapshot)),
            *snapshot.warnings.active(),
        ]

    def _unseen(self, snapshot: MapSnapshot) -> tuple[str, ...]:
        """Notes on obstacles that noise of the map hides, if that makes plans slower."""
        vehicle, ground = self.parameters.model.vehicle, snapshot.elevation_map
        hidden = hides_steps(ground, vehicle)
        return sight_notes(ground, vehicle)[:1] if hidden else ()

    def degraded(self, snapshot: MapSnapshot | None) -> list[str]:
        """Reasons in the map for slower plans."""
        return [] if snapshot is None else self._map_age(snapshot).reasons()

    def _map_age(self, snapshot: MapSnapshot) -> MapAge:
        limit = self.parameters.model.limits.speed
        return MapAge.of(snapshot, self.config.planning.max_map_age, limit)
