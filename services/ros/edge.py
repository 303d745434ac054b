"""The edge: paths, maps and odometry of ROS 2 in; speed limit, profile and diagnostics out.

It does not plan, it sends requests to a running service. One thread requests and publishes, another
forwards maps, so that a large map does not delay a limit.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple
from uuid import uuid4

import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.client import ClientAnswer, PlanClient
from slopewise.services.io.bag_paths import other_frame
from slopewise.services.io.bags import GRID_MAP, PATH, SPEED_LIMIT
from slopewise.services.io.grid_map import elevation_map_of
from slopewise.services.ros import conversions as ros
from slopewise.services.ros import speed_limit
from slopewise.services.ros.conversions import Condition, OdometrySample
from slopewise.services.ros.inbox import Received, decoded
from slopewise.services.ros.node import Node
from slopewise.services.ros.settings import EdgeSettings
from slopewise.services.ros.speed_limit import SpeedAdvice
from slopewise.services.ros.topic_matching import ConnectionWatch
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire.map_message import update_of
from slopewise.services.wire.plan_messages import Path, Plan, PlanReply

_log = logging.getLogger("slopewise")

_DIAGNOSTICS_PERIOD = 0.5
"""Time between diagnostics that do not change, the usual rate of ROS nodes [s]."""

_PATIENCE = 2.0  # Time for a thread to end before the final stop is sent [s]
_MAP_WAIT = 0.5  # Time for which the thread of maps waits before it checks whether to end [s]


class _Offer(NamedTuple):
    """Candidate with its frame and its arrival, monotonic [s]."""

    path: Path
    frame: str
    at: float


class RosEdge:
    """A running edge; a context manager."""

    def __init__(
        self,
        settings: EdgeSettings,
        ros_session: zenoh.Session,
        service_session: zenoh.Session,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect ROS 2 on one session with the service on another, or on the same."""
        self.settings, self._clock = settings, clock
        topics, ours = settings.topics, settings.ros
        node = Node(ros_session, ours.domain, ours.namespace, ours.node, clock, ours.distribution)
        self.node, self.inbox = node, node.inbox
        self._paths = tuple(node.subscribe(topic, PATH) for topic in topics.paths)
        self._map = node.subscribe(topics.map, GRID_MAP, latched=True) if topics.map else ""
        self._state = VehicleState(settings, node, service_session)
        self._limit = node.publisher(topics.speed_limit, SPEED_LIMIT)
        self._stop, self._profile, self._diagnostics = (
            node.publisher(topic, kind) if topic else None
            for topic, kind in (
                (topics.stop, ros.BOOL),
                (topics.profile, PATH),
                (topics.diagnostics, ros.DIAGNOSTICS),
            )
        )
        self._connect(service_session)
        self._source, self._maps = f"ros-{uuid4().hex[:12]}", 0
        self._assumed: tuple[str, ...] = ()
        self._frame = ours.frame
        self._offers: dict[str, _Offer] = {}
        self._answer: ClientAnswer | None = None
        self._last_stop: bool | None = None
        self._diagnosed = 0.0
        self._stopped = threading.Event()
        self._threads = [
            threading.Thread(target=loop, name=loop.__name__, daemon=True)
            for loop in (self._run, self._take_maps)
        ]

    def _connect(self, service_session: zenoh.Session) -> None:
        """Clients of the service, and the watch of topics without a counterpart."""
        ours, service = self.settings.ros, self.settings.service
        required = [*self._paths, self._limit.topic, *self._state.topics[:1], self._map]
        required += [self._stop.topic] if self._stop is not None else []
        self._connections = ConnectionWatch(
            [*filter(None, required)], service_session, service.namespace, ours.node
        )
        self._client = PlanClient(
            service_session,
            namespace=service.namespace,
            name=f"ros-{ours.node}",
            timeout=service.timeout,
            deceleration=self.settings.stop.deceleration,
            dead_time=self.settings.stop.dead_time,
        )
        self._map_client = PlanClient(service_session, namespace=service.namespace)

    def __enter__(self) -> RosEdge:
        """Start; the first limits are stops."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Send a final stop, because silence follows."""
        self._stopped.set()
        with self.inbox.news:
            self.inbox.news.notify_all()
        for thread in self._threads:
            thread.join(_PATIENCE)
        self._send_stop("the speed planner is leaving")
        self._client.__exit__(None, None, None)
        self._map_client.__exit__(None, None, None)
        self.node.__exit__(None, None, None)

    def wait(self, seconds: float | None = None) -> None:
        """Wait for :meth:`stop`, or for a time."""
        self._stopped.wait(seconds)

    def stop(self) -> None:
        """Let :meth:`wait` return."""
        self._stopped.set()

    # ------------------------------------------------------------------ limits

    def _run(self) -> None:
        topics, period = (*self._paths, *self._state.topics), self.settings.timing.period
        due = self._clock()
        while not self._stopped.is_set():
            received = self.inbox.take(topics, due)
            try:
                for scheme in self.node.follow():
                    _log.warning("a robot speaks %s; from now on we do as well", scheme.value)
                self._state.take(received)
                is_new = self._take_paths(received)
                if is_new or self._clock() >= due:
                    due = self._clock() + period
                    self._plan()
            except Exception:  # noqa: BLE001 - logged and reported; the last limit must not stay
                _log.exception("no limit could be made")
                self._offers.clear()
                due = self._clock() + period
                self._send_stop("fault of the edge, see its log")

    def _take_paths(self, received: dict[str, list[Received]]) -> bool:
        """Store new candidates; return True if there is one."""
        is_new = False
        for topic in self._paths:
            if topic not in received:
                continue
            newest = received[topic][-1]
            # A path that cannot be used replaces the one before it.
            self._offers.pop(topic, None)
            message = decoded(self.inbox, topic, newest, PATH)
            if message is None:
                continue
            frame = self._frame or message.header.frame_id
            try:
                path = ros.candidate_of(topic, message)
            except ParameterError as error:
                self.inbox.refuse(topic, str(error))
                continue
            if wrong := other_frame(message, frame):
                self.inbox.refuse(topic, f"expected frame {frame}, got {wrong}")
                continue
            self._offers[topic] = _Offer(path, frame, newest.at)
            is_new = True
        return is_new

    def _plan(self) -> None:
        now, timing = self._clock(), self.settings.timing
        self._offers = {t: o for t, o in self._offers.items() if now - o.at <= timing.path_age}
        motion, missing = self._motion(now)
        if missing or motion is None:
            self._answer = None
            self._send_stop(missing)
            self._send_profile(None, None)
            return
        paths = [ros.ahead_of(o.path, motion, timing.horizon) for o in self._offers.values()]
        pose = (motion.x, motion.y, motion.heading)
        self._answer = answer = self._client.plan(motion.speed, paths, pose=pose)
        reply = answer.reply
        if reply is None:
            self._send_stop(answer.stop.reason if answer.stop else "no answer")
            self._send_profile(None, motion)
            return
        late = self._state.late(self._clock())
        advice = speed_limit.advice_from_reply(reply, motion.x, motion.y, timing, late)
        # The limit goes first: the profile takes longer to write.
        self._send(advice)
        plan = next((p for p in reply.plans if p.candidate == reply.chosen), None)
        self._send_profile(None if advice.stop else plan, motion)

    def _motion(self, now: float) -> tuple[OdometrySample | None, str]:
        """Motion in the frame of the candidates, or the reason why nothing can be planned."""
        frames = {offer.frame for offer in self._offers.values()}
        if not frames:
            refused = [f"{t}: {r}" for t, r in self.inbox.refused.items() if t in self._paths]
            missing = f"no path within {self.settings.timing.path_age:g} s"
            return None, "; ".join((missing, *refused))
        if len(frames) > 1:
            return None, f"expected paths in one frame, got {', '.join(sorted(frames))}"
        return self._state.motion(now, *frames)

    # ------------------------------------------------------------------ out

    def _send_stop(self, reason: str) -> None:
        self._send(speed_limit.stop(self.settings.timing, reason))

    def _send(self, advice: SpeedAdvice) -> None:
        stamp = self._state.clock()
        self._limit.send(ros.speed_limit(advice, stamp))
        if self._stop is not None:
            self._stop.send(ros.flag(advice.stop))
        has_changed = self._last_stop != advice.stop
        self._last_stop = advice.stop
        if has_changed or self._clock() - self._diagnosed > _DIAGNOSTICS_PERIOD:
            self._diagnosed = self._clock()
            self._diagnose(advice, stamp)

    def _send_profile(self, plan: Plan | None, motion: OdometrySample | None) -> None:
        if self._profile is None:
            return
        at = None
        if plan is not None and motion is not None:
            at = speed_limit.place_on(plan, motion.x, motion.y)
        frame = self._frame if motion is None else motion.frame
        self._profile.send(ros.profile(plan, at, frame, self._state.clock()))

    def _diagnose(self, advice: SpeedAdvice, stamp: int) -> None:
        connections = self._connections.check(self.node.matches(), self.node.schemes)
        if self._diagnostics is None:
            return
        reply = None if self._answer is None else self._answer.reply
        values = [("limit [m/s]", f"{advice.limit:.3f}"), ("stop", str(advice.stop).lower())]
        values.append(("stamps", self._state.stamps()))
        if self._answer is not None:
            values.append(("answer in [ms]", f"{1e3 * self._answer.seconds:.1f}"))
        values += [] if reply is None else _facts_of(reply)
        values += [(name, str(count)) for name, count in sorted(self.inbox.counters.items())]
        values += [(f"refused {topic}", text) for topic, text in sorted(self.inbox.refused.items())]
        has_warning = advice.reason or (reply is not None and reply.flags)
        level = ros.ERROR if advice.stop else ros.WARN if has_warning else ros.OK
        plan = Condition("speed plan", level, advice.reason or "speed limit holds", values)
        namespace = self.settings.service.namespace
        self._diagnostics.send(ros.diagnostics((plan, connections), namespace, stamp))

    # ------------------------------------------------------------------ maps

    def _take_maps(self) -> None:
        while self._map and not self._stopped.is_set():
            received = self.inbox.take((self._map,), self._clock() + _MAP_WAIT)
            if not received:
                continue
            message = decoded(self.inbox, self._map, received[self._map][-1], GRID_MAP)
            if message is None:
                continue
            try:
                self._forward_map(message)
            except ParameterError as error:
                self.inbox.refuse(self._map, str(error))
            except zenoh.ZError as error:
                self.inbox.refuse(self._map, f"the service was not reached: {error}")

    def _forward_map(self, message: Any) -> None:
        frame = message.header.frame_id
        if self._frame and frame.lstrip("/") != self._frame.lstrip("/"):
            raise ParameterError("header.frame_id", f"{self._frame}, got {frame}")
        ground = elevation_map_of(message, self.settings.topics.layer)
        self._frame = self._frame or frame
        self._maps += 1
        if ground.assumed != self._assumed:
            self._assumed = ground.assumed
            text = " ".join(ground.assumed) or "no undeclared no-data now"
            _log.warning("%s: %s", self._map, text)
        self._map_client.put_map(update_of(ground, self._source, self._maps))


def _facts_of(reply: PlanReply) -> list[tuple[str, str]]:
    return [
        ("status", reply.status),
        ("reason", reply.reason),
        ("chosen", reply.chosen or ""),
        ("map version", str(reply.map_version)),
        ("map age [s]", "–" if reply.map_age is None else f"{reply.map_age:.2f}"),
        ("flags", "; ".join(reply.flags)),
    ]
