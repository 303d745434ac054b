"""Inputs and output of the guard on ROS 2: ``cmd_vel`` in and out, odometry, a flag to brake.

The numbers that rmw_zenoh attaches to messages reveal repeated and lost ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import zenoh

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion
from slopewise.services.guard.settings import GuardRos
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.guard.zenoh_transport import GuardInput
from slopewise.services.io.bags import read_cdr, typestore
from slopewise.services.ros.conversions import (
    BOOL,
    ODOMETRY,
    angles_of,
    flag,
    header,
    motion_of,
    stamp_of,
)
from slopewise.services.ros.inbox import Received
from slopewise.services.ros.naming import read_attachment
from slopewise.services.ros.node import Node

_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class RosOutput:
    """Decisions as a twist and a flag."""

    def __init__(self, session: zenoh.Session, settings: GuardRos, name: str) -> None:
        ours = settings
        self.node = Node(session, ours.domain, ours.namespace, name, distribution=ours.distribution)
        self._kind = f"geometry_msgs/msg/{ours.kind}"
        self._output = self.node.publisher(ours.output, self._kind)
        self._stop = self.node.publisher(ours.stop, BOOL) if ours.stop else None
        self.stamp = 0  # of the newest odometry [ns]

    def send(self, decision: GuardDecision) -> None:
        """Send a decision to the base."""
        self.node.follow()
        types = typestore().types
        vector, command = types["geometry_msgs/msg/Vector3"], decision.command
        linear, angular = vector(command.speed, 0.0, 0.0), vector(0.0, 0.0, command.yaw_rate)
        twist = types["geometry_msgs/msg/Twist"](linear, angular)
        if self._kind.endswith("Stamped"):
            twist = types[self._kind](header("base_link", self.stamp), twist)
        self._output.send(twist)
        if self._stop is not None:
            self._stop.send(flag(decision.brake))

    def close(self) -> None:
        """Disappear from the graph."""
        self.node.__exit__(None, None, None)


class RosTransport(RosOutput):
    """Commands, odometry and confirmed poses in."""

    def __init__(self, session: zenoh.Session, settings: GuardRos) -> None:
        super().__init__(session, settings, settings.node)
        self._frame = self._used_frame = settings.frame.lstrip("/")
        self.inbox = self.node.inbox
        odometry = self.node.subscribe(settings.odometry, ODOMETRY)
        command = self.node.subscribe(settings.command, self._kind)
        confirmed = self.node.subscribe(settings.confirm, _POSE)
        self._inputs: dict[str, tuple[str, Callable[[Any, int], Any]]] = {
            odometry: (ODOMETRY, self._motion_of),
            command: (self._kind, _command_of),
            confirmed: (_POSE, self._confirmed_of),
        }
        self.topics: dict[str, str] = {odometry: "motion", command: "command", confirmed: "confirm"}
        self.inbox.all_of |= self.topics.keys()  # senders that alternate are seen by all messages

    def read(self, topic: str, item: Received) -> GuardInput:
        """Decode a message."""
        kind, value_of = self._inputs[topic]
        message = read_cdr(item.raw, kind, topic, "")
        sender, sequence = _sender_of(item)
        return value_of(message, sequence or 0), sender, sequence, _stamp_of(message)

    def _motion_of(self, message: Any, _: int) -> VehicleMotion:
        frame = _frame_of(message, self._frame)
        motion = motion_of(message)
        self.stamp, self._used_frame = motion.stamp, frame
        pose = Pose2d(motion.x, motion.y, motion.heading)
        return VehicleMotion(pose, motion.speed, message.twist.twist.angular.z)

    def _confirmed_of(self, message: Any, _: int) -> Pose2d:
        _frame_of(message, self._used_frame)
        if _stamp_of(message) is None:
            raise ParameterError("header.stamp", "the time of the confirmation, got 0")
        pose = message.pose.pose
        return Pose2d(pose.position.x, pose.position.y, angles_of(pose.orientation)[2])


def _frame_of(message: Any, required: str) -> str:
    """Frame of a message, which has to be the required one if there is one."""
    frame: str = message.header.frame_id.lstrip("/")
    if required and frame != required:
        raise ParameterError("header.frame_id", f"{required}, got {frame}")
    return frame


def _command_of(message: Any, number: int) -> tuple[BaseCommand, int]:
    twist = message.twist if hasattr(message, "twist") else message
    command = BaseCommand(twist.linear.x, twist.angular.z)
    if not all(map(math.isfinite, command)):
        raise ParameterError("twist", "finite numbers")
    if twist.linear.y:
        raise ParameterError("twist.linear.y", f"0, it drives ahead, got {twist.linear.y:g}")
    return command, number


def _stamp_of(message: Any) -> float | None:
    """Stamp of a header [s]; None without one, or where it is not filled in."""
    if not hasattr(message, "header"):
        return None
    return 1e-9 * stamp_of(message.header) or None


def _sender_of(item: Received) -> tuple[str, int | None]:
    try:
        attached = read_attachment(item.attachment)
    except (ParameterError, InputError):
        return "", None
    return attached.gid.hex(), attached.sequence
