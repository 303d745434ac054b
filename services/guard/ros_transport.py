"""Inputs and output of the guard on ROS 2: ``cmd_vel`` in and out, odometry, a flag to brake.

The numbers that rmw_zenoh attaches to messages reveal repeated and lost ones.
"""

from __future__ import annotations

import math
from typing import Any

import zenoh

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.guard.command_arc import Pose2d
from slopewise.services.guard.core import BaseDecision, Guard
from slopewise.services.guard.decide import BaseCommand, VehicleMotion
from slopewise.services.guard.settings import GuardRos
from slopewise.services.io.bags import typestore
from slopewise.services.ros.inbox import Inbox, Received, decoded
from slopewise.services.ros.naming import read_attachment
from slopewise.services.ros.node import Node

_ODOMETRY, _BOOL = "nav_msgs/msg/Odometry", "std_msgs/msg/Bool"

_UNIT_TOLERANCE = 0.1
"""Deviation of a quaternion's length from 1: rounding, not a value that was never filled in [1]."""


class RosOutput:
    """Decisions as a twist and a flag."""

    def __init__(self, session: zenoh.Session, settings: GuardRos, name: str) -> None:
        """Declare a node and its topics."""
        ours = settings
        self.node = Node(session, ours.domain, ours.namespace, name, distribution=ours.distribution)
        self._kind = f"geometry_msgs/msg/{ours.kind}"
        self._output = self.node.publisher(ours.output, self._kind)
        self._stop = self.node.publisher(ours.stop, _BOOL) if ours.stop else None
        self.stamp: Any = None

    def send(self, answer: BaseDecision) -> None:
        """Send a decision to the base."""
        self.node.follow()
        types = typestore().types
        vector, command = types["geometry_msgs/msg/Vector3"], answer.decision.command
        linear, angular = vector(command.speed, 0.0, 0.0), vector(0.0, 0.0, command.yaw_rate)
        twist = types["geometry_msgs/msg/Twist"](linear, angular)
        if self._kind.endswith("Stamped"):
            stamp = self.stamp or types["builtin_interfaces/msg/Time"](0, 0)
            twist = types[self._kind](types["std_msgs/msg/Header"](stamp, "base_link"), twist)
        self._output.send(twist)
        if self._stop is not None:
            self._stop.send(types[_BOOL](answer.decision.brake))

    def close(self) -> None:
        """Disappear from the graph."""
        self.node.__exit__(None, None, None)


class RosTransport(RosOutput):
    """Commands and odometry in."""

    def __init__(self, session: zenoh.Session, settings: GuardRos) -> None:
        """Subscribe."""
        super().__init__(session, settings, settings.node)
        self._frame = settings.frame.lstrip("/")
        self._odometry = self.node.subscribe(settings.odometry, _ODOMETRY)
        self._command = self.node.subscribe(settings.command, self._kind)
        self.inbox: Inbox = self.node.inbox
        self.topics: tuple[str, ...] = (self._odometry, self._command)

    def take(self, guard: Guard, received: dict[str, list[Received]]) -> bool:
        """Hand messages over to the guard; return True if a new command is among them."""
        commanded = False
        for topic, kind in ((self._odometry, _ODOMETRY), (self._command, self._kind)):
            feed: Any = guard.motions if topic == self._odometry else guard.commands
            for item in received.get(topic, ()):
                message = decoded(self.inbox, topic, item, kind)
                sender, sequence = _sender_of(item)
                try:
                    if message is None:
                        feed.drop()
                        continue
                    is_odometry = topic == self._odometry
                    value: Any = self._motion(message) if is_odometry else _command_of(message)
                    value = value if is_odometry else (value, sequence or 0)
                    is_new = feed.take(value, item.at, sender, sequence, _stamp_of(message))
                    if is_odometry:
                        self.stamp = message.header.stamp
                    else:
                        commanded |= is_new
                except ParameterError as error:
                    feed.drop()
                    self.inbox.refuse(topic, str(error))
        return commanded

    def _motion(self, message: Any) -> VehicleMotion:
        frame = message.header.frame_id.lstrip("/")
        if self._frame and frame != self._frame:
            raise ParameterError("header.frame_id", f"{self._frame}, got {frame}")
        position, q = message.pose.pose.position, message.pose.pose.orientation
        length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
        if not abs(length - 1.0) < _UNIT_TOLERANCE:
            raise ParameterError("orientation", f"a quaternion of length 1, got {length:.3g}")
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        speed = message.twist.twist.linear.x
        if not all(map(math.isfinite, (position.x, position.y, yaw, speed))):
            raise ParameterError("pose, twist", "finite numbers")
        return VehicleMotion(Pose2d(position.x, position.y, yaw), speed)


def _command_of(message: Any) -> BaseCommand:
    twist = message.twist if hasattr(message, "twist") else message
    command = BaseCommand(twist.linear.x, twist.angular.z)
    if not all(map(math.isfinite, command)):
        raise ParameterError("twist", "finite numbers")
    if twist.linear.y:
        raise ParameterError("twist.linear.y", f"0, it drives ahead, got {twist.linear.y:g}")
    return command


def _stamp_of(message: Any) -> float | None:
    """Stamp of a header [s]; None without one, or where it is not filled in."""
    if not hasattr(message, "header"):
        return None
    stamp = message.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec) or None


def _sender_of(item: Received) -> tuple[str, int | None]:
    try:
        attached = read_attachment(item.attachment)
    except (ParameterError, InputError):
        return "", None
    return attached.gid.hex(), attached.sequence
