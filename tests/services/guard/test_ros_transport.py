"""Stamps of ROS messages that the guard receives."""

from __future__ import annotations

import time
from typing import Any

import pytest
import zenoh

pytest.importorskip("rosbags", reason="the ros extra is not installed")


from slopewise.services.guard.core import Guard
from slopewise.services.guard.ros_transport import RosTransport
from slopewise.services.guard.settings import GuardRos, GuardSettings, GuardTiming
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.guard.worker import hand_over
from slopewise.services.ros.node import Node
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.guard.guard_fixtures import FLAT, MODEL
from tests.services.ros.ros_messages import command, odometry, pose_of


@pytest.mark.parametrize("late", [0.0, 2.0])
def test_header_stamps_are_read(late: float) -> None:
    """Odometry that was sent 2 s ago is 2 s old; an unfilled stamp does not exist."""
    settings = GuardSettings(
        model="atv", ros=GuardRos(enabled=True), timing=GuardTiming(clock="shared")
    )
    guard = Guard(settings, MODEL, FLAT)
    with zenoh.open(zenoh_config(ZenohSettings(mode="peer", listen=()))) as session:
        transport = RosTransport(session, settings.ros)
        with Node(session, 0, "/", "robot") as node:
            odom = node.publisher("odom", "nav_msgs/msg/Odometry")
            twist = node.publisher("cmd_vel_nav", "geometry_msgs/msg/TwistStamped")
            time.sleep(0.2)
            unfilled: Any = command(1.0)
            unfilled.header.stamp.sec = 0
            odom.send(odometry(1.0, stamp=time.time() - late))
            twist.send(unfilled)
            time.sleep(0.2)
            inbox = transport.inbox
            hand_over(guard, transport, inbox.take(tuple(transport.topics), time.monotonic() + 5.0))
        transport.close()
    now = time.monotonic()
    assert guard.stamps() == {"command": "none", "odometry": "shared clock"}
    assert late < guard.motions.newest.age(now) < late + 1.0
    if late:
        assert "s old (stamp), limit 0.2 s" in guard.motions.missing(now)


def test_confirmed_pose_is_in_the_frame_of_odometry() -> None:
    """The tool of RViz sends one; of another frame, or without stamp, it is refused alone."""
    guard, confirmed = Guard(GuardSettings(model="atv"), MODEL, FLAT), []
    refused: list[str] = []
    with zenoh.open(zenoh_config(ZenohSettings(mode="peer", listen=()))) as session:
        transport = RosTransport(session, GuardRos(enabled=True))
        guard.confirm = lambda pose, *_: bool(confirmed.append(pose))  # type: ignore[method-assign]
        with Node(session, 0, "/", "robot") as node:
            odom = node.publisher("odom", "nav_msgs/msg/Odometry")
            rviz = node.publisher("guard_pose", "geometry_msgs/msg/PoseWithCovarianceStamped")
            time.sleep(0.2)
            odom.send(odometry(0.0, x=3.0, frame="map"))
            for frame in ("odom", "map"):
                rviz.send(pose_of(3.1, 0.2, frame))
            unfilled = pose_of(3.1, 0.2, "map")
            unfilled.header.stamp.sec = 0
            rviz.send(unfilled)
            time.sleep(0.2)
            inbox = transport.inbox
            inbox.refuse = lambda topic, reason: refused.append(reason)  # type: ignore[method-assign]
            hand_over(guard, transport, inbox.take(tuple(transport.topics), time.monotonic() + 5.0))
        transport.close()
    assert confirmed == [Pose2d(pytest.approx(3.1), 0.0, pytest.approx(0.2))]
    assert refused[0].endswith("expected map, got odom")
    assert "header.stamp" in refused[1]
    assert (guard.motions.has_messages, guard.motions.rejection) == (True, "")
