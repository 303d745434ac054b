"""Answers questions for plans; knows nothing of the wire they came on.

A named client has a moving horizon of its own; a question without a name stands alone. One
candidate that cannot be used is refused with a reason, the others are planned.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import InputError, ParameterError
from planner.answer import FULL_STOP, State, command_of
from planner.answer import Command as PlannedCommand
from planner.candidates import CandidatePlanner, rank
from planner.ground import Conditions
from planner.horizon import Horizon
from planner.limiting import Limiting
from planner.path import CandidatePath, batch
from planner.plan import SpeedPlan, Status
from planner.uncertainty import Uncertainty
from services import messages
from services.config import ServiceConfig
from services.map_store import KnownGround
from services.messages import Candidate, Command, Limit, Path, Plan, PlanReply, PlanRequest
from services.parameters_in_use import ParametersInUse

_FEWEST_POINTS = 3
_FARTHEST = 1e9
"""Coordinates beyond that are none [m]."""

_FASTEST = 1e3
"""Speeds beyond that are none [m/s]."""


class _Client:
    """A client's horizon; one question at a time."""

    def __init__(self, horizon: Horizon, parameters: ParametersInUse) -> None:
        self.lock = threading.Lock()
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
        self._local = threading.local()

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

    def answer(self, request: PlanRequest, ground: KnownGround | None, source: str) -> PlanReply:
        """The answer to one question.

        Args:
            request: as it came. ground: as it is known now. source: key, for errors.

        Raises:
            InputError: the question as a whole cannot be used.
        """
        begun = time.perf_counter()
        self._check(request, source)
        parameters = self.parameters
        if ground is None:
            return self._reply(request, parameters, None, "no map has come yet: full braking")
        spacing = self.config.planning.planner().spacing_on(ground.elevation_map.resolution)
        usable, refused = self._usable(request, spacing, source)
        checked = time.perf_counter()
        plan = self._go_on if request.client else self._stand_alone
        try:
            reply = plan(request, parameters, ground, usable)
        except ParameterError as error:
            usable, more = _without_flaws(usable, spacing)
            if not more:
                raise InputError(source, error.field, f"expected {error.expected}") from None
            refused += more
            reply = plan(request, parameters, ground, usable)
        seconds = {
            **reply.seconds,
            "check": checked - begun,
            "planner": time.perf_counter() - checked,
        }
        return _with(reply, ranking=[*reply.ranking, *refused], seconds=seconds)

    # ------------------------------------------------------------------ questions

    def _check(self, request: PlanRequest, source: str) -> None:
        most = self.config.sizes.candidates
        if len(request.paths) > most:
            found = f"got {len(request.paths)}"
            raise InputError(source, "paths", f"expected at most {most} candidates, {found}")
        if request.client and request.pose is None:
            raise InputError(source, "pose", "expected x, y, heading of a named client, got none")
        if not abs(request.speed) <= _FASTEST:
            found = f"got {request.speed:g} m/s"
            raise InputError(source, "speed", f"expected at most {_FASTEST:g} m/s, {found}")
        if request.pose is not None and not max(map(abs, request.pose)) <= _FARTHEST:
            raise InputError(source, "pose", f"expected coordinates of at most {_FARTHEST:g} m")
        if not request.client and request.speed < 0.0:
            found = f"got {request.speed:g} m/s"
            raise InputError(source, "speed", f"expected a speed >= 0 without a client, {found}")

    def _usable(
        self, request: PlanRequest, spacing: float, source: str
    ) -> tuple[list[_Usable], list[Candidate]]:
        """Candidates in the order given; and those that are refused at a glance, with reasons."""
        usable: dict[str, _Usable] = {}
        refused: list[Candidate] = []
        stations = 0.0
        lengths = self._lengths(request.paths)
        for path, length in zip(request.paths, lengths, strict=True):
            try:
                if path.name in usable:
                    raise ParameterError("name", "a name of its own, got one used before")
                if isinstance(length, ParameterError):
                    raise length
                if path.clear is not None and not path.clear >= 0.0:
                    raise ParameterError("clear", f"a distance >= 0 [m], got {path.clear}")
                stations += length / spacing + _FEWEST_POINTS
                candidate = CandidatePath(path.name, path.points, path.speed_limit)
                usable[path.name] = _Usable(candidate, _clear_of(path, request))
            except ParameterError as error:
                refused.append(Candidate(name=path.name, usable=False, reason=str(error)))
        most = self.config.sizes.stations
        if stations > most:
            words = f"expected at most {most} stations in all, got {stations:.0f}"
            raise InputError(source, "paths", words)
        return list(usable.values()), refused

    def _lengths(self, paths: Sequence[Path]) -> list[float | ParameterError]:
        """Length of each polyline [m], or what can be seen to be wrong with it at a glance.

        All in one go: one by one, small arrays cost more than what is done with them.
        """
        sizes = self.config.sizes
        found = [_misshapen(path.points, sizes.points) for path in paths]
        good = [i for i, fault in enumerate(found) if not isinstance(fault, ParameterError)]
        if not good:
            return found
        points = np.concatenate([paths[i].points for i in good])
        ends = np.cumsum([len(paths[i].points) for i in good])
        begins = np.concatenate(([0], ends[:-1]))
        with np.errstate(all="ignore"):
            reach = np.maximum.reduceat(np.abs(points).ravel(), 2 * begins)
            steps = points[1:] - points[:-1]
            between = ends[:-1] - 1
            squares = np.einsum("ij,ij->i", steps, steps)
            squares[between] = np.inf
            least = np.minimum.reduceat(squares, begins)
            squares[between] = 0.0
            length = np.add.reduceat(np.sqrt(squares), begins)
        for k, i in enumerate(good):
            # NaN is never below or above anything.
            if not reach[k] <= _FARTHEST:
                found[i] = ParameterError("points", "finite coordinates [m]")
            elif not least[k] > 0.0:
                at = int(np.argmin(squares[begins[k] : ends[k] - 1])) + 1
                words = "a place of its own: stations have to grow"
                found[i] = ParameterError(f"points[{at}]", words)
            elif length[k] > sizes.stations:
                words = f"a path of at most {sizes.stations} m, got {length[k]:g}"
                found[i] = ParameterError("points", words)
            else:
                found[i] = float(length[k])
        return found

    # ------------------------------------------------------------------ planning

    def _go_on(
        self, request: PlanRequest, parameters: ParametersInUse, ground: KnownGround,
        usable: list[_Usable],
    ) -> PlanReply:  # fmt: skip
        assert request.pose is not None
        x, y, heading = request.pose
        state = State(x=x, y=y, heading=heading, speed=request.speed)
        client = self._client(request.client, parameters)
        with client.lock:
            if client.identity != parameters.identity:
                client.horizon.learn(parameters.model, self._survives(parameters))
                client.identity = parameters.identity
            answer = client.horizon.step(
                state, [u.path for u in usable], ground.elevation_map,
                clear=np.array([u.clear for u in usable]) if usable else np.inf,
                conditions=_conditions(request),
            )  # fmt: skip
        ranking = [
            Candidate(name=r.candidate, usable=r.valid, reason=r.reason, cost=_finite(r.cost))
            for r in answer.ranking
        ]
        reply = self._reply(
            request, parameters, ground, answer.reason, answer.status, answer.command,
            answer.chosen, answer.plans,
        )  # fmt: skip
        stages = {f"planner.{stage}": s for stage, s in answer.seconds.items()}
        return _with(reply, ranking=ranking, kept=answer.kept, seconds=stages)

    def _client(self, name: str, parameters: ParametersInUse) -> _Client:
        with self._lock:
            known = self._clients.pop(name, None)
            if known is None:
                planning = self.config.planning
                horizon = Horizon(
                    parameters.model, planning.horizon(), planning.planner(),
                    self._survives(parameters),
                )  # fmt: skip
                known = _Client(horizon, parameters)
            self._clients[name] = known
            while len(self._clients) > self.config.planning.clients:
                self._clients.popitem(last=False)
            return known

    def _stand_alone(
        self, request: PlanRequest, parameters: ParametersInUse, ground: KnownGround,
        usable: list[_Usable],
    ) -> PlanReply:  # fmt: skip
        if not usable:
            return self._reply(request, parameters, ground, "no candidate is usable: full braking")
        planner = self._planner(parameters)
        plans: list[SpeedPlan] = []
        for free in sorted({u.clear for u in usable}):
            plans += planner.plan(
                ground.elevation_map, [u.path for u in usable if u.clear == free],
                start_speed=request.speed, clear=free, conditions=_conditions(request),
            )  # fmt: skip
        settings = self.config.planning.planner()
        plans = rank(plans, settings)
        best = plans[0]
        ranking = [
            Candidate(
                name=p.candidate,
                usable=p.status is not Status.INFEASIBLE,
                reason=p.reason,
                cost=p.travel_time + settings.horizon_penalty * (float(p.station[-1]) - p.progress),
            )
            for p in plans
        ]
        command = FULL_STOP
        if best.status is not Status.INFEASIBLE:
            command = command_of(best, 0.0, 0.0, self.config.planning.period)
        reply = self._reply(
            request, parameters, ground, best.reason, best.status, command, best, plans
        )
        return _with(reply, ranking=ranking)

    def _planner(self, parameters: ParametersInUse) -> CandidatePlanner:
        """The planner of this thread: solvers are nobody else's meanwhile."""
        if getattr(self._local, "identity", None) != parameters.identity:
            settings = self.config.planning.planner()
            survives = self._survives(parameters)
            self._local.planner = CandidatePlanner(parameters.model, settings, survives)
            self._local.identity = parameters.identity
        planner: CandidatePlanner = self._local.planner
        return planner

    def _survives(self, parameters: ParametersInUse) -> Uncertainty:
        return parameters.uncertainty or self._uncertainty

    # ------------------------------------------------------------------ answers

    def _reply(
        self, request: PlanRequest, parameters: ParametersInUse, ground: KnownGround | None,
        reason: str, status: Status = Status.DEGRADED, command: PlannedCommand = FULL_STOP,
        chosen: SpeedPlan | None = None, plans: Sequence[SpeedPlan] = (),
    ) -> PlanReply:  # fmt: skip
        return PlanReply(
            status=status.value,
            reason=reason,
            service=self.config.id,
            sequence=request.sequence,
            parameters=parameters.message(),
            map_version=0 if ground is None else ground.version,
            map_age=None if ground is None else ground.age(),
            command=Command(
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
        flags = ["map is old"] if old else []
        return [*flags, "map updates were lost"] if ground.incomplete else flags


@dataclass(frozen=True, slots=True)
class _Usable:
    """A candidate, and the station up to which its way is known free [m]."""

    path: CandidatePath
    clear: float


def _misshapen(points: np.ndarray, most: int) -> float | ParameterError:
    """What is wrong with the shape of a polyline; 0 if nothing is."""
    if points.ndim != 2 or points.shape[1] != 2:
        return ParameterError("points", f"an array (n, 2) of x, y, got shape {points.shape}")
    if not _FEWEST_POINTS <= len(points) <= most:
        words = f"{_FEWEST_POINTS} … {most} points, got {len(points)}"
        return ParameterError("points", words)
    return 0.0


def _without_flaws(
    offered: Sequence[_Usable], spacing: float
) -> tuple[list[_Usable], list[Candidate]]:
    """Candidates that stations can be laid along; and the others, with reasons."""
    usable: list[_Usable] = []
    refused: list[Candidate] = []
    for one in offered:
        try:
            batch([one.path], spacing)
            usable.append(one)
        except ParameterError as error:
            refused.append(Candidate(name=one.path.name, usable=False, reason=str(error)))
    return usable, refused


def _clear_of(path: Path, request: PlanRequest) -> float:
    clear = request.clear if path.clear is None else path.clear
    return np.inf if clear is None else clear


def _conditions(request: PlanRequest) -> Conditions:
    return Conditions(session_time=request.session_time, brake_heat=request.brake_heat)


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
    )


def _with(reply: PlanReply, **changes: object) -> PlanReply:
    fields = {name: getattr(reply, name) for name in reply.__struct_fields__}
    return PlanReply(**(fields | changes))
