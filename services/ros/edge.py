"""The edge: paths, maps and odometry of ROS 2 in; speed limit, profile and diagnostics out.

It plans nothing itself, it asks a running service. One thread asks and publishes, another takes up
maps, so that a large map does not delay a limit.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any
from uuid import uuid4

import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.client import ClientAnswer, PlanClient
from slopewise.services.io.bag_paths import other_frame
from slopewise.services.io.bags import GRID_MAP, PATH, SPEED_LIMIT
from slopewise.services.io.grid_map import elevation_map_of
from slopewise.services.ros import conversions as ros
from slopewise.services.ros import speed_limit
from slopewise.services.ros.connections import ConnectionWatch
from slopewise.services.ros.conversions import Condition, OdometrySample
from slopewise.services.ros.inbox import Received, decoded
from slopewise.services.ros.node import Node
from slopewise.services.ros.settings import EdgeSettings
from slopewise.services.ros.speed_limit import SpeedAdvice
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire.plan_messages import MapUpdate, Path, Plan

_log = logging.getLogger("slopewise")
_DIAGNOSE = 0.5
_PATIENCE = 2.0


@dataclass(frozen=True, slots=True)
class _Offered:
    """A candidate as it came. ``at``: monotonic [s]."""

    path: Path
    frame: str
    at: float


class Edge:
    """A running edge; a context manager."""

    def __init__(
        self,
        settings: EdgeSettings,
        ros_session: zenoh.Session,
        service_session: zenoh.Session,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Meet ROS 2 on one session and the service on another, or on the same.

        Args:
            settings: of the edge. ros_session, service_session: open. clock: monotonic [s].
        """
        self.settings = settings
        topics, ours = settings.topics, settings.ros
        self._clock = clock
        node = Node(ros_session, ours.domain, ours.namespace, ours.node, clock, ours.distribution)
        self.node, self.inbox = node, node.inbox
        self._paths = tuple(node.subscribe(topic, PATH) for topic in topics.paths)
        self._map = node.subscribe(topics.map, GRID_MAP, latched=True) if topics.map else ""
        self._state = VehicleState(settings, node, service_session)
        self._limit = node.publisher(topics.speed_limit, SPEED_LIMIT)
        self._stop = node.publisher(topics.stop, ros.BOOL) if topics.stop else None
        self._profile = node.publisher(topics.profile, PATH) if topics.profile else None
        self._diagnostics = (
            node.publisher(topics.diagnostics, ros.DIAGNOSTICS) if topics.diagnostics else None
        )
        needed = [*self._paths, self._limit.topic, *self._state.topics[:1]]
        needed += [self._stop.topic] if self._stop is not None else []
        self._connections = ConnectionWatch(
            [*needed, self._map] if self._map else needed,
            service_session,
            settings.service.namespace,
            ours.node,
        )
        asked = settings.service
        self._client = PlanClient(
            service_session,
            namespace=asked.namespace,
            name=f"ros-{settings.ros.node}",
            timeout=asked.timeout,
            deceleration=settings.stop.deceleration,
            dead_time=settings.stop.dead_time,
        )
        self._map_client = PlanClient(service_session, namespace=asked.namespace)
        self._source, self._maps = f"ros-{uuid4().hex[:12]}", 0
        self._assumed: tuple[str, ...] = ()
        self._frame = settings.ros.frame
        self._offered: dict[str, _Offered] = {}
        self._outcome: ClientAnswer | None = None
        self._last_told: SpeedAdvice | None = None
        self._diagnosed = 0.0
        self._stopped = threading.Event()
        self._threads = [
            threading.Thread(target=loop, name=loop.__name__, daemon=True)
            for loop in (self._run, self._take_maps)
        ]

    def __enter__(self) -> Edge:
        """Begin: the first limits say stop."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Say stop once more, because nobody will say anything after that."""
        self._stopped.set()
        with self.inbox.news:
            self.inbox.news.notify_all()
        for thread in self._threads:
            thread.join(_PATIENCE)
        self._tell(self._no("the speed planner is leaving"))
        self._client.__exit__(None, None, None)
        self._map_client.__exit__(None, None, None)
        self.node.__exit__(None, None, None)

    def wait(self, seconds: float | None = None) -> None:
        """Until :meth:`stop`, or for so long."""
        self._stopped.wait(seconds)

    def stop(self) -> None:
        """Let :meth:`wait` return."""
        self._stopped.set()

    # ------------------------------------------------------------------ limits

    def _run(self) -> None:
        topics, period = (*self._paths, *self._state.topics), self.settings.timing.period
        due = self._clock()
        while not self._stopped.is_set():
            found = self.inbox.take(topics, due)
            try:
                for speech in self.node.follow():
                    _log.warning("a robot speaks %s; so do we now, too", speech.value)
                self._state.take(found)
                fresh = self._take_paths(found)
                if fresh or self._clock() >= due:
                    due = self._clock() + period
                    self._plan()
            except Exception:  # noqa: BLE001 - logged, and said; the last limit must not stand
                _log.exception("no limit could be made")
                self._offered.clear()
                due = self._clock() + period
                self._tell(self._no("fault of the edge, see its log"))

    def _take_paths(self, found: dict[str, list[Received]]) -> bool:
        fresh = False
        for topic in self._paths:
            if topic not in found:
                continue
            newest = found[topic][-1]
            # A path that cannot be used takes the place of the one before it.
            self._offered.pop(topic, None)
            message = decoded(self.inbox, topic, newest, PATH)
            if message is None:
                continue
            try:
                path = ros.candidate_of(topic, message)
            except ParameterError as error:
                self.inbox.refuse(topic, str(error))
                continue
            frame = self._frame or message.header.frame_id
            if other := other_frame(message, frame):
                self.inbox.refuse(topic, f"expected frame {frame}, got {other}")
                continue
            self._offered[topic] = _Offered(path, frame, newest.at)
            fresh = True
        return fresh

    def _plan(self) -> None:
        now, age = self._clock(), self.settings.timing.path_age
        self._offered = {t: o for t, o in self._offered.items() if now - o.at <= age}
        offered = list(self._offered.values())
        frames = {o.frame for o in offered}
        motion, missing = self._state.motion(now, *frames) if len(frames) == 1 else (None, "")
        if len(frames) > 1:
            missing = f"expected paths in one frame, got {', '.join(sorted(frames))}"
        if not offered:
            missing = f"no path within {age:g} s"
        if missing or motion is None:
            self._outcome = None
            self._tell(self._no(missing))
            self._show(None, None)
            return
        horizon = self.settings.timing.horizon
        paths = [ros.ahead_of(o.path, motion, horizon) for o in offered]
        pose = (motion.x, motion.y, motion.heading)
        outcome = self._client.plan(motion.speed, paths, pose=pose)
        self._outcome, reply = outcome, outcome.reply
        if reply is None:
            self._tell(self._no(outcome.stop.reason if outcome.stop else "no answer"))
            self._show(None, motion)
            return
        late = self._state.late(self._clock())
        told = speed_limit.told_by(reply, motion.x, motion.y, self.settings.timing, late)
        # The limit goes first: the profile takes longer to write.
        self._tell(told)
        plan = next((p for p in reply.plans if p.candidate == reply.chosen), None)
        self._show(None if told.stop else plan, motion)

    def _no(self, reason: str) -> SpeedAdvice:
        return speed_limit.stop(self.settings.timing, reason)

    # ------------------------------------------------------------------ out

    def _tell(self, told: SpeedAdvice) -> None:
        stamp = self._state.clock()
        self._limit.send(ros.speed_limit(told, stamp))
        if self._stop is not None:
            self._stop.send(ros.flag(told.stop))
        changed = self._last_told is None or self._last_told.stop != told.stop
        self._last_told = told
        if changed or self._clock() - self._diagnosed > _DIAGNOSE:
            self._diagnosed = self._clock()
            self._diagnose(told, stamp)

    def _show(self, plan: Plan | None, motion: OdometrySample | None) -> None:
        if self._profile is None:
            return
        at = None
        if plan is not None and motion is not None:
            at = speed_limit.place_on(plan, motion.x, motion.y)
        frame = self._frame if motion is None else motion.frame
        self._profile.send(ros.profile(plan, at, frame, self._state.clock()))

    def _diagnose(self, told: SpeedAdvice, stamp: int) -> None:
        heard = self._connections.look(self.node.audiences(), self.node.speeches)
        if self._diagnostics is None:
            return
        reply = None if self._outcome is None else self._outcome.reply
        flags = [] if reply is None else reply.flags
        values = [("limit [m/s]", f"{told.limit:.3f}"), ("stop", str(told.stop).lower())]
        values.append(("stamps", self._state.stamps()))
        if self._outcome is not None:
            values.append(("answer in [ms]", f"{1e3 * self._outcome.seconds:.1f}"))
        if reply is not None:
            age = "–" if reply.map_age is None else f"{reply.map_age:.2f}"
            values += [
                ("status", reply.status),
                ("reason", reply.reason),
                ("chosen", reply.chosen or ""),
                ("map version", str(reply.map_version)),
                ("map age [s]", age),
                ("flags", "; ".join(flags)),
            ]
        values += [(name, str(count)) for name, count in sorted(self.inbox.counters.items())]
        values += [(f"refused {topic}", why) for topic, why in sorted(self.inbox.refused.items())]
        level = ros.ERROR if told.stop else ros.WARN if flags or told.reason else ros.OK
        plan = Condition("speed plan", level, told.reason or "speed limit holds", values)
        name = self.settings.service.namespace
        self._diagnostics.send(ros.diagnostics((plan, heard), name, stamp))

    # ------------------------------------------------------------------ maps

    def _take_maps(self) -> None:
        while self._map and not self._stopped.is_set():
            found = self.inbox.take((self._map,), self._clock() + 0.5)
            if not found:
                continue
            message = decoded(self.inbox, self._map, found[self._map][-1], GRID_MAP)
            if message is None:
                continue
            try:
                self._bring(message)
            except ParameterError as error:
                self.inbox.refuse(self._map, str(error))
            except zenoh.ZError as error:
                self.inbox.refuse(self._map, f"the service was not reached: {error}")

    def _bring(self, message: Any) -> None:
        frame = message.header.frame_id
        if self._frame and frame.lstrip("/") != self._frame.lstrip("/"):
            raise ParameterError("header.frame_id", f"{self._frame}, got {frame}")
        ground = elevation_map_of(message, self.settings.topics.layer)
        self._frame = self._frame or frame
        self._maps += 1
        if ground.assumed != self._assumed:
            self._assumed = ground.assumed
            _log.warning(
                "%s: %s", self._map, " ".join(ground.assumed) or "no undeclared no-data now"
            )
        self._map_client.put_map(
            MapUpdate(
                source=self._source,
                sequence=self._maps,
                elevation=ground.elevation,
                resolution=ground.resolution,
                origin=ground.origin,
                height_std=ground.height_std,
            )
        )
