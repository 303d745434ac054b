"""The guard on topics of ROS 2: ``cmd_vel`` in and out, odometry, a flag that says brake and hold.

What numbers are attached to messages by rmw_zenoh counts for repeated and lost ones.
"""

from __future__ import annotations

import math
from typing import Any

import zenoh

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.guard.arc import PlanarPose
from slopewise.services.guard.core import BaseWord, Guard
from slopewise.services.guard.decide import BaseCommand, VehicleMotion
from slopewise.services.guard.settings import GuardRos
from slopewise.services.io.bags import typestore
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.ros.inbox import decoded as decoded_cdr
from slopewise.services.ros.naming import read_attachment
from slopewise.services.ros.node import Node

_ODOMETRY, _BOOL = "nav_msgs/msg/Odometry", "std_msgs/msg/Bool"


class RosOutput:
    """Words to the base: a twist, and a flag."""

    def __init__(self, session: zenoh.Session, settings: GuardRos, name: str) -> None:
        """Show a node and its topics."""
        ours = settings
        self.node = Node(session, ours.domain, ours.namespace, name, distribution=ours.distribution)
        self._stamped = ours.kind == "TwistStamped"
        self._kind = f"geometry_msgs/msg/{ours.kind}"
        self._output = self.node.publisher(ours.output, self._kind)
        self._stop = self.node.publisher(ours.stop, _BOOL) if ours.stop else None
        self.stamp: Any = None

    def say(self, word: BaseWord) -> None:
        """Tell the base."""
        self.node.follow()
        types = typestore().types
        vector, command = types["geometry_msgs/msg/Vector3"], word.decision.command
        twist = types["geometry_msgs/msg/Twist"](
            vector(command.speed, 0.0, 0.0), vector(0.0, 0.0, command.yaw_rate)
        )
        if self._stamped:
            stamp = self.stamp or types["builtin_interfaces/msg/Time"](0, 0)
            header = types["std_msgs/msg/Header"](stamp, "base_link")
            twist = types[self._kind](header, twist)
        self._output.send(twist)
        if self._stop is not None:
            self._stop.send(types[_BOOL](word.decision.brake))

    def close(self) -> None:
        """Leave."""
        self.node.__exit__(None, None, None)


class RosWire(RosOutput):
    """Commands and odometry in."""

    def __init__(self, session: zenoh.Session, settings: GuardRos) -> None:
        """Listen."""
        super().__init__(session, settings, settings.node)
        self._frame = settings.frame
        self._odometry = self.node.subscribe(settings.odometry, _ODOMETRY)
        self._command = self.node.subscribe(settings.command, self._kind)
        self.inbox: Inbox = self.node.inbox
        self.topics: tuple[str, ...] = (self._odometry, self._command)

    def take(self, guard: Guard, found: dict[str, list[Received]]) -> bool:
        """Hand over what came; whether a command is among it."""
        commanded = False
        for topic, kind in ((self._odometry, _ODOMETRY), (self._command, self._kind)):
            feed: Any = guard.motions if topic == self._odometry else guard.commands
            for received in found.get(topic, ()):
                message = decoded_cdr(self.inbox, topic, received, kind)
                sender, sequence = _numbered(received)
                try:
                    if message is None:
                        feed.drop()
                    elif topic == self._odometry:
                        motion, time = self._motion(message), _stamp_of(message)
                        guard.motions.take(motion, received.at, sender, sequence, time)
                        self.stamp = message.header.stamp
                    else:
                        told, time = (_command_of(message), sequence or 0), _stamp_of(message)
                        commanded |= guard.commands.take(told, received.at, sender, sequence, time)
                except ParameterError as error:
                    feed.drop()
                    self.inbox.refuse(topic, str(error))
        return commanded

    def _motion(self, message: Any) -> VehicleMotion:
        frame = message.header.frame_id.lstrip("/")
        if self._frame and frame != self._frame.lstrip("/"):
            raise ParameterError("header.frame_id", f"{self._frame}, got {frame}")
        pose = message.pose.pose
        q = pose.orientation
        length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
        if not 0.9 < length < 1.1:
            raise ParameterError("orientation", f"a quaternion of length 1, got {length:.3g}")
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        speed = message.twist.twist.linear.x
        if not all(map(math.isfinite, (pose.position.x, pose.position.y, yaw, speed))):
            raise ParameterError("pose, twist", "finite numbers")
        return VehicleMotion(PlanarPose(pose.position.x, pose.position.y, yaw), speed)


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


def _numbered(received: Received) -> tuple[str, int | None]:
    try:
        attached = read_attachment(received.attachment)
    except (ParameterError, InputError):
        return "", None
    return attached.gid.hex(), attached.sequence
