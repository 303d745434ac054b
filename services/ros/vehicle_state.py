"""State of the vehicle from ROS 2: odometry for planning, and samples to learn from."""

from __future__ import annotations

import time
from functools import partial
from typing import Any
from uuid import uuid4

import numpy as np
import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.conversions import OdometrySample
from slopewise.services.ros.frames import Frames
from slopewise.services.ros.inbox import Received, decoded
from slopewise.services.ros.node import Node
from slopewise.services.ros.settings import EdgeSettings
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.lateness import RECOVERY, Lateness, WallClock
from slopewise.services.wire.observations import DriveSamples

_MIN_ROWS, _MAX_ROWS = 10, 50
"""Samples of a message: with fewer no stop is found, more would delay it by over a second [1]."""

_STALE = 0.5  # Age of a value from which it ends a stretch of samples [s]


class VehicleState:
    """Odometry, IMU, joints and commands from the inbox of a node."""

    def __init__(self, settings: EdgeSettings, node: Node, service: zenoh.Session) -> None:
        """Subscribe to the topics of the settings."""
        topics, timing = settings.topics, settings.timing
        self._settings, self._inbox = settings, node.inbox
        self._actions: dict[str, tuple[str, Any]] = {}
        for topic, kind, act in (
            (topics.odometry, ros.ODOMETRY, self._on_odometry),
            (topics.imu, ros.IMU, self._on_imu),
            (topics.joints, ros.JOINTS, self._on_joints),
            (topics.command, f"geometry_msgs/msg/{topics.command_type}", self._on_command),
        ):
            if topic:
                self._actions[node.subscribe(topic, kind)] = (kind, act)
        self._frames = Frames(timing.transform_age)
        for topic, is_fixed in ((topics.tf, False), (topics.tf_static, True)):
            if topic:
                name = node.subscribe(topic, ros.TRANSFORMS, latched=topic == topics.tf_static)
                self._actions[name] = ros.TRANSFORMS, partial(self._frames.take, fixed=is_fixed)
                # Several nodes publish a part of the tree each.
                self._inbox.all_of.add(name)
        self._motion: OdometrySample | None = None
        self._at = -float("inf")
        wall = WallClock() if timing.clock == "shared" else None
        uses_stamps = timing.clock != "ignored"
        self._lateness = Lateness(timing.max_latency, wall, uses_stamps=uses_stamps)
        self._samples: SamplePublisher | None = None
        if topics.imu and topics.command:
            wheels = ("v_left", "v_right") if topics.joints and settings.wheels.left else ()
            columns = ("v", "v_cmd", "pitch", "roll", "yaw_rate", *wheels)
            self._samples = SamplePublisher(service, settings.service.namespace, columns)

    @property
    def topics(self) -> tuple[str, ...]:
        """Full names of the subscriptions."""
        return tuple(self._actions)

    def take(self, received: dict[str, list[Received]]) -> None:
        """Process new messages; odometry last, because a sample is recorded with it."""
        for topic, (kind, act) in reversed(self._actions.items()):
            for item in received.get(topic, ()):
                message = decoded(self._inbox, topic, item, kind)
                if message is None:
                    continue
                try:
                    act(message, item.at)
                except ParameterError as error:
                    self._inbox.refuse(topic, str(error))

    def motion(self, now: float, frame: str) -> tuple[OdometrySample | None, str]:
        """Motion of the vehicle now in a frame, or the reason why it is not known."""
        if self._motion is None:
            return None, "no odometry"
        if age := self._lateness.objection(now, self._settings.timing.odometry_age):
            return None, f"odometry is {age}"
        try:
            return self._frames.motion_in(frame, self._motion, now), ""
        except ParameterError as error:
            return None, f"expected {error.expected}"

    def late(self, now: float) -> float:
        """Age of the motion that is not exceeded, if clocks or delay are as declared [s]."""
        return self._lateness.bound(now)

    def stamps(self) -> str:
        """Use of the stamps of odometry, and faults seen in them, as text."""
        lateness = self._lateness
        repeated = ", repeated" if lateness.repeated else ""
        stepped = ", clock set" if self._inbox.clock() - lateness.stepped <= RECOVERY else ""
        return f"{lateness.stamps}{repeated}{stepped}"

    def clock(self) -> int:
        """Time of ROS [ns]: that of the last odometry, and the time since then.

        So it is simulated time where odometry is simulated.
        """
        if self._motion is None:
            return time.time_ns()
        return self._motion.stamp + round(1e9 * (self._inbox.clock() - self._at))

    def _on_odometry(self, message: Any, at: float) -> None:
        motion = ros.motion_of(message)
        # The next odometry is awaited where the stamp of one is refused.
        if not self._lateness.take(1e-9 * motion.stamp or None, at):
            return
        self._motion, self._at = motion, at
        self._put(at, v=motion.speed)
        if self._samples is not None:
            self._samples.record(at)

    def _on_imu(self, message: Any, at: float) -> None:
        roll, pitch, _ = ros.angles_of(message.orientation)
        self._put(at, roll=roll, pitch=pitch, yaw_rate=float(message.angular_velocity.z))

    def _on_joints(self, message: Any, at: float) -> None:
        wheels, names = self._settings.wheels, list(message.name)
        if self._samples is None or not wheels.left:
            return
        for column, joint in (("v_left", wheels.left), ("v_right", wheels.right)):
            if joint not in names or len(message.velocity) != len(names):
                raise ParameterError("velocity", f"one of joint {joint}, got {', '.join(names)}")
            self._put(at, **{column: float(message.velocity[names.index(joint)]) * wheels.radius})

    def _on_command(self, message: Any, at: float) -> None:
        twist = message.twist if hasattr(message, "twist") else message
        self._put(at, v_cmd=float(twist.linear.x))

    def _put(self, at: float, **values: float) -> None:
        if self._samples is not None:
            self._samples.latest.update({name: (at, value) for name, value in values.items()})


class SamplePublisher:
    """Collects a sample with each odometry, and sends them in messages."""

    def __init__(self, session: zenoh.Session, namespace: str, columns: tuple[str, ...]) -> None:
        """Publish to the service; ``columns``: besides t, v, v_cmd and pitch among them."""
        self.latest: dict[str, tuple[float, float]] = {}  # arrival [s] and value by column
        self._columns = columns
        self._rows: list[tuple[float, ...]] = []
        self._source, self._sequence = f"ros-{uuid4().hex[:12]}", 0
        self._publisher = session.declare_publisher(
            f"{namespace}/v1/obs/drive", congestion_control=zenoh.CongestionControl.DROP
        )

    def record(self, at: float) -> None:
        """Record a sample; a value that is missing or old ends the stretch."""
        values = [self.latest.get(name) for name in self._columns]
        # A stop command comes once, and stays in force.
        fresh = all(
            value is not None
            and np.isfinite(value[1])
            and (at - value[0] < _STALE or name == "v_cmd")
            for name, value in zip(self._columns, values, strict=True)
        )
        if fresh and (not self._rows or at > self._rows[-1][0]):
            self._rows.append((at, *(value[1] for value in values if value is not None)))
        if len(self._rows) >= (_MAX_ROWS if fresh else _MIN_ROWS):
            self._send()
        if not fresh:
            self._rows.clear()

    def _send(self) -> None:
        self._sequence += 1
        message = DriveSamples(
            source=self._source,
            sequence=self._sequence,
            time=time.monotonic(),
            columns=["t", *self._columns],
            values=np.array(self._rows).T,
        )
        self._publisher.put(**codec.payload_of(message, Format.MESSAGEPACK))
        self._rows.clear()
