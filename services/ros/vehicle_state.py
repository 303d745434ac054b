"""What ROS 2 says of the vehicle: odometry for planning, and samples to learn from."""

from __future__ import annotations

import time
from typing import Any

import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.conversions import OdometrySample
from slopewise.services.ros.drive_samples import SampleTeller
from slopewise.services.ros.frames import Frames
from slopewise.services.ros.inbox import Received, decoded
from slopewise.services.ros.node import Node
from slopewise.services.ros.settings import EdgeSettings
from slopewise.services.wire.lateness import Lateness, WallClock
from slopewise.services.wire.sender_clock import RECOVERY


class VehicleState:
    """Takes odometry, IMU, joints and commands out of the inbox of a node."""

    def __init__(self, settings: EdgeSettings, node: Node, service: zenoh.Session) -> None:
        """Subscribe to what the settings name."""
        topics = settings.topics
        self._settings, self._inbox = settings, node.inbox
        self._kinds: dict[str, tuple[str, Any]] = {}
        wanted = (
            (topics.odometry, ros.ODOMETRY, self._on_odometry),
            (topics.imu, ros.IMU, self._on_imu),
            (topics.joints, ros.JOINTS, self._on_joints),
            (topics.command, f"geometry_msgs/msg/{topics.command_type}", self._on_command),
        )
        for topic, kind, act in wanted:
            if topic:
                self._kinds[node.subscribe(topic, kind)] = (kind, act)
        self._frames = Frames(settings.timing.transform_age)
        for topic, act in ((topics.tf, self._on_transforms), (topics.tf_static, self._on_fixed)):
            if topic:
                name = node.subscribe(topic, ros.TRANSFORMS, latched=topic == topics.tf_static)
                self._kinds[name] = (ros.TRANSFORMS, act)
                # Many publish a part of the tree each.
                self._inbox.all_of.add(name)
        self._motion: OdometrySample | None = None
        self._at = -float("inf")
        timing = settings.timing
        wall = WallClock() if timing.clock == "shared" else None
        uses_stamps = timing.clock != "ignored"
        self._lateness = Lateness(timing.max_latency, wall, uses_stamps=uses_stamps)
        self._teller: SampleTeller | None = None
        if topics.imu and topics.command:
            wheels = ("v_left", "v_right") if topics.joints and settings.wheels.left else ()
            columns = ("v", "v_cmd", "pitch", "roll", "yaw_rate", *wheels)
            self._teller = SampleTeller(service, settings.service.namespace, columns)

    @property
    def topics(self) -> tuple[str, ...]:
        """Full names of what is subscribed to."""
        return tuple(self._kinds)

    def take(self, found: dict[str, list[Received]]) -> None:
        """Look at new messages; odometry comes last, because a sample is taken with it."""
        for topic, (kind, act) in reversed(self._kinds.items()):
            for received in found.get(topic, ()):
                message = decoded(self._inbox, topic, received, kind)
                if message is None:
                    continue
                try:
                    act(message, received.at)
                except ParameterError as error:
                    self._inbox.refuse(topic, str(error))

    def motion(self, now: float, frame: str) -> tuple[OdometrySample | None, str]:
        """The vehicle now, or why nobody knows.

        Args:
            now: monotonic clock [s]. frame: of the candidates.
        """
        if self._motion is None:
            return None, "no odometry"
        if old := self._lateness.objection(now, self._settings.timing.odometry_age):
            return None, f"odometry is {old}"
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
        """The time of ROS [ns]: that of the last odometry and what passed since then.

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
        if self._teller is not None:
            self._teller.now.put(at, v=self._motion.speed)
            self._teller.sample(at)

    def _on_transforms(self, message: Any, at: float) -> None:
        self._frames.take(message, at)

    def _on_fixed(self, message: Any, at: float) -> None:
        self._frames.take(message, at, fixed=True)

    def _on_imu(self, message: Any, at: float) -> None:
        roll, pitch, _ = ros.angles_of(message.orientation)
        if self._teller is not None:
            rate = float(message.angular_velocity.z)
            self._teller.now.put(at, roll=roll, pitch=pitch, yaw_rate=rate)

    def _on_joints(self, message: Any, at: float) -> None:
        wheels, names = self._settings.wheels, list(message.name)
        if self._teller is None or not wheels.left:
            return
        for column, joint in (("v_left", wheels.left), ("v_right", wheels.right)):
            if joint not in names or len(message.velocity) != len(names):
                raise ParameterError("velocity", f"one of joint {joint}, got {', '.join(names)}")
            speed = float(message.velocity[names.index(joint)]) * wheels.radius
            self._teller.now.put(at, **{column: speed})

    def _on_command(self, message: Any, at: float) -> None:
        twist = message.twist if hasattr(message, "twist") else message
        if self._teller is not None:
            self._teller.now.put(at, v_cmd=float(twist.linear.x))
