"""Client of the plan service; of the package it needs only the modules imported here.

Every request has an answer in time. Without a usable reply of the service it is a safe stop of the
client: brake as hard as the brakes can, with the speed that results.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import zenoh

from slopewise.models.errors import InputError, ParameterError
from slopewise.models.typed_arguments import typed_arguments
from slopewise.services.wire import codec, plan_messages
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import MapUpdate, Path, PlanReply, PlanRequest

_MAX_REPLY = 256_000_000
"""Bytes of a reply: 64 candidates of 2,000 stations and 20 columns are 20 MB."""

_SAMPLES = 50
"""Samples of a safe stop: 0.1 m/s apart from 5 m/s."""

_SERVICE_SHARE = 0.8
"""Share of the time-out that the service may use; the rest is for the wire, 20 ms of 0.1 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeStop:
    """Stop of the vehicle from now on, for lack of a usable reply.

    Attributes:
        time, speed: (N,) speed is held for the dead time and then falls evenly [s], [m/s].
        distance: stopping distance at that deceleration [m].
        reason: one sentence.
    """

    time: np.ndarray
    speed: np.ndarray
    distance: float
    reason: str


@dataclass(frozen=True, slots=True)
class ClientAnswer:
    """Either a reply whose plan may be driven, or a safe stop; one of them is None.

    ``seconds``: from request to outcome.
    """

    reply: PlanReply | None
    stop: SafeStop | None
    seconds: float


class PlanClient:
    """Client of one service; a context manager. One thread at a time."""

    @typed_arguments
    def __init__(
        self,
        session: zenoh.Session,
        *,
        namespace: str = "slopewise/robot",
        name: str = "",
        timeout: float = 0.1,
        deceleration: float = 1.5,
        dead_time: float = 0.5,
        written: Format = Format.MESSAGEPACK,
        reserved: bool = False,
    ) -> None:
        """Prepare requests on an open session.

        Args:
            session: open zenoh session.
            namespace: namespace of the service's keys.
            name: name of this client; with one, the service extends the plan that it drives.
            timeout: time limit of a request [s].
            deceleration: deceleration of the safe stop, which the brakes certainly reach [m/s²].
            dead_time: dead time of the safe stop [s].
            written: format of the payloads.
            reserved: use the key for clients that drive, if access is given to it.
        """
        for field, value in (("timeout", timeout), ("deceleration", deceleration)):
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(field, f"a finite number > 0, got {value}")
        if not (np.isfinite(dead_time) and dead_time >= 0.0):
            raise ParameterError("dead_time", f"a finite number >= 0 [s], got {dead_time}")
        self._session, self._name, self._written = session, name, written
        self._timeout, self._deceleration, self._dead_time = timeout, deceleration, dead_time
        self._plan_key = f"{namespace}/v1/plan" + ("/drive" if reserved else "")
        self._map_key = f"{namespace}/v1/map"
        self._sequence = 0
        self._querier = session.declare_querier(self._plan_key, timeout=timeout, express=True)

    def __enter__(self) -> PlanClient:
        return self

    def __exit__(self, *_: object) -> None:
        """Undeclare the querier; the session stays open."""
        self._querier.undeclare()

    @typed_arguments
    def plan(
        self,
        speed: float,
        paths: Sequence[Path],
        *,
        pose: tuple[float, float, float] | None = None,
        pose_age: float = 0.0,
        clear: float | None = None,
    ) -> ClientAnswer:
        """Request a plan: an answer within the time-out, never an error of the wire.

        Args:
            speed: vehicle speed [m/s].
            paths: candidates.
            pose: x, y, heading [m, m, rad].
            pose_age: time since pose and speed were measured, with its transport [s].
            clear: station up to which the path is known to be free [m]; None: each whole path.
        """
        begun = time.perf_counter()
        self._sequence += 1
        request = PlanRequest(
            speed=speed,
            paths=list(paths),
            client=self._name,
            pose=pose,
            pose_age=pose_age,
            clear=clear,
            sequence=self._sequence,
        )
        try:
            reply = self._ask(request)
            reason = "no service answers" if reply is None else _objection(reply, request)
        except (zenoh.ZError, InputError) as error:
            reply, reason = None, str(error)
        took = time.perf_counter() - begun
        if reply is None or reason:
            return ClientAnswer(None, self.safe_stop(speed, reason), took)
        return ClientAnswer(reply, None, took)

    def safe_stop(self, speed: float, reason: str) -> SafeStop:
        """The safe stop from a speed [m/s]; one that is not finite is taken as 0."""
        begin = max(float(speed), 0.0) if np.isfinite(speed) else 0.0
        braking = begin / self._deceleration
        fall = np.linspace(0.0, braking, _SAMPLES)
        moment = np.concatenate(([0.0], self._dead_time + fall))
        slower = np.maximum(begin - self._deceleration * fall, 0.0)
        slower[-1] = 0.0
        distance = begin * self._dead_time + 0.5 * begin * braking
        return SafeStop(
            time=moment, speed=np.concatenate(([begin], slower)), distance=distance, reason=reason
        )

    @typed_arguments
    def put_map(self, update: MapUpdate) -> None:
        """Send ground; that it arrived shows in the map version of the next reply."""
        self._session.put(
            self._map_key,
            **codec.payload_of(update, self._written),
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    def _ask(self, request: PlanRequest) -> PlanReply | None:
        deadline = f"deadline={_SERVICE_SHARE * self._timeout:.6f}"
        payload = codec.payload_of(request, self._written)
        replies = self._querier.get(parameters=deadline, **payload)
        for reply in replies:
            if reply.ok is not None:
                sample = reply.ok
                return codec.decode(
                    PlanReply, sample.payload, str(sample.encoding), self._plan_key, _MAX_REPLY
                )
        return None


def _objection(reply: PlanReply, request: PlanRequest) -> str:
    """Reason why a reply cannot be driven; empty if it can."""
    if reply.status in (plan_messages.BUSY, plan_messages.ERROR):
        return f"{reply.status}: {reply.reason}"
    if reply.sequence != request.sequence:
        return f"the answer is to request {reply.sequence}, not {request.sequence}"
    if reply.command is None:
        return "the answer holds no command"
    if any(not np.isfinite(plan.column("speed")).all() for plan in reply.plans):
        return "the answer holds speeds that are no numbers"
    return ""
