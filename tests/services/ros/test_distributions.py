"""A robot of each distribution, on a router: messages both ways, and missing matches."""

from __future__ import annotations

import logging
import struct
import time
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.io.bags import PATH, SPEED_LIMIT, type_hashes, typestore
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.graph import KeyScheme
from slopewise.services.ros.inbox import decoded
from slopewise.services.ros.naming import NO_HASH
from slopewise.services.ros.node import Node
from slopewise.services.ros.speed_limit import SpeedAdvice
from slopewise.services.ros.topic_matching import ConnectionWatch
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services import grid_maps
from tests.services.service_process import free_port, until

LIMIT, PLAN = "speed_limit", "plan"
TYPES = {SPEED_LIMIT: "nav2_msgs::msg::dds_::SpeedLimit_", PATH: "nav_msgs::msg::dds_::Path_"}
BRIDGED = {SPEED_LIMIT: "nav2_msgs§msg§SpeedLimit", PATH: "nav_msgs§msg§Path"}
ATTACHMENT = struct.pack("<qqB16s", 1, 2, 16, bytes(16))


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    address = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(zenoh_config(ZenohSettings(mode="router", listen=(address,)))):
        yield address


@pytest.fixture
def sessions(endpoint: str) -> Iterator[tuple[zenoh.Session, zenoh.Session]]:
    client = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
    with zenoh.open(client) as ours, zenoh.open(client) as theirs:
        yield ours, theirs


class RosRobot:
    """Keys and tokens as a distribution writes them."""

    def __init__(self, session: zenoh.Session, distribution: str, domain: int) -> None:
        self.session, self.received = session, []
        self.distribution, self.domain = distribution, domain
        self.declared = [
            session.declare_subscriber(self.key(LIMIT, SPEED_LIMIT), self.received.append),
            session.liveliness().declare_token(self.token("MS", LIMIT, SPEED_LIMIT)),
            session.liveliness().declare_token(self.token("MP", PLAN, PATH)),
        ]

    def type_hash(self, kind: str) -> str:
        return NO_HASH if self.distribution == "humble" else type_hashes(kind)[0]

    def key(self, topic: str, kind: str) -> str:
        if self.distribution == "dds":
            return topic
        return f"{self.domain}/{topic}/{TYPES[kind]}/{self.type_hash(kind)}"

    def token(self, entity: str, topic: str, kind: str) -> str:
        session, end = self.session.info.zid(), "/cpu" if self.distribution == "lyrical" else ""
        if self.distribution == "dds":
            return f"@/{session}/@ros2_lv/{entity}/{topic}/{BRIDGED[kind]}/:1:0:0,10"
        number = {"MS": 8, "MP": 9}[entity]
        named = f"%{topic}/{TYPES[kind]}/{self.type_hash(kind)}/::,10:,:,:,,{end}"
        return f"@ros2_lv/{self.domain}/{session}/7/{number}/{entity}/%/%/nav/{named}"

    def send(self, message: Any) -> None:
        attachment = None if self.distribution == "dds" else ATTACHMENT
        payload = bytes(typestore().serialize_cdr(message, PATH))
        self.session.put(self.key(PLAN, PATH), payload, attachment=attachment)


@pytest.mark.parametrize("setting", ["auto", "set"])
@pytest.mark.parametrize("distribution", ["humble", "jazzy", "kilted", "lyrical", "dds"])
def test_messages_of_each_distribution_pass_both_ways(
    sessions: tuple[zenoh.Session, zenoh.Session], distribution: str, setting: str
) -> None:
    our_session, their_session = sessions
    domain = 20 + len(distribution)
    robot = RosRobot(their_session, distribution, domain)
    chosen = distribution if setting == "set" else "auto"
    with Node(our_session, domain, "/", "slopewise", distribution=chosen) as node:
        limit = node.publisher(LIMIT, SPEED_LIMIT)
        plan = node.subscribe(PLAN, PATH)

        def is_connected() -> bool:
            node.follow()
            return not any(match.missing for match in node.matches())

        until(is_connected)
        assert {a.nodes for a in node.matches()} == {
            (f"zenoh-bridge-ros2dds {str(their_session.info.zid())[:8]}",)
            if distribution == "dds"
            else ("/nav",)
        }
        limit.send(ros.speed_limit(SpeedAdvice(1.25, False, ""), 0))
        until(lambda: robot.received)
        (sample,) = robot.received
        message: Any = typestore().deserialize_cdr(sample.payload.to_bytes(), SPEED_LIMIT)
        assert message.speed_limit == 1.25
        assert len(sample.attachment.to_bytes()) == 33
        robot.send(grid_maps.path([[0.0, 0.0], [1.0, 0.5]]))
        (received,) = node.inbox.take((plan,), time.monotonic() + 5.0)[plan]
        assert len(decoded(node.inbox, plan, received, PATH).poses) == 2


def test_unhashed_and_hashed_robots_together(sessions: tuple[zenoh.Session, zenoh.Session]) -> None:
    our_session, their_session = sessions
    robots = [RosRobot(their_session, distribution, 31) for distribution in ("humble", "jazzy")]
    with Node(our_session, 31, "/", "slopewise") as node:
        limit = node.publisher(LIMIT, SPEED_LIMIT)
        until(lambda: node.follow() or KeyScheme.UNHASHED in node.schemes)
        limit.send(ros.speed_limit(SpeedAdvice(0.5, False, ""), 0))
        until(lambda: all(robot.received for robot in robots))
        assert [len(robot.received) for robot in robots] == [1, 1]


def test_missing_match_is_in_diagnostics_and_log(
    sessions: tuple[zenoh.Session, zenoh.Session], caplog: pytest.LogCaptureFixture
) -> None:
    our_session, their_session = sessions
    with Node(our_session, 40, "/", "slopewise", distribution="jazzy") as node:
        node.publisher(LIMIT, SPEED_LIMIT)
        connections = ConnectionWatch(["/speed_limit"])
        with caplog.at_level(logging.WARNING, "slopewise"):
            for _ in range(3):
                condition = connections.check(node.matches(), node.schemes)
        assert condition.level == ros.WARN
        assert condition.message.startswith("no node subscribes to /speed_limit with our type")
        assert caplog.text.count("no node subscribes") == 1
        unhashed = RosRobot(their_session, "humble", 40)
        until(lambda: "Humble" in connections.check(node.matches(), node.schemes).message)
        jazzy = RosRobot(their_session, "jazzy", 40)
        until(lambda: connections.check(node.matches(), node.schemes).level == ros.OK)
        assert unhashed.session is jazzy.session
