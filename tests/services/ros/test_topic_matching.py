"""Tokens of every distribution, and the cause where no node is at the other end of a topic."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.io.bags import PATH, SPEED_LIMIT, type_hashes
from slopewise.services.ros.graph import Endpoint, KeyScheme, endpoint_of
from slopewise.services.ros.naming import (
    NO_HASH,
    NODE,
    NULL_HASH,
    PUBLISHER,
    SUBSCRIPTION,
    Identity,
)
from slopewise.services.ros.topic_matching import OwnTopic, match_topic

HASH = type_hashes(SPEED_LIMIT)[0]
TYPE = "nav2_msgs::msg::dds_::SpeedLimit_"
HEAD = "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/3"
LIMIT = OwnTopic("/speed_limit", SPEED_LIMIT, PUBLISHER)


def subscription(
    type_hash: str = HASH,
    topic: str = "/speed_limit",
    kind: str = SPEED_LIMIT,
    domain: int | None = 0,
    node: str = "/controller_server",
) -> Endpoint:
    return Endpoint(SUBSCRIPTION, domain, "ab", node, topic, kind, type_hash)


class GraphStub:
    """A graph of some endpoints."""

    def __init__(self, *endpoints: Endpoint) -> None:
        self.domain, self._all = 0, list(endpoints)

    def all(self) -> list[Endpoint]:
        return self._all

    def here(self) -> list[Endpoint]:
        return [e for e in self._all if e.domain in (0, None) and e.entity != NODE]


def missing(
    *endpoints: Endpoint, topic: OwnTopic = LIMIT, scheme: KeyScheme = KeyScheme.HASHED
) -> str:
    graph: Any = GraphStub(*endpoints)
    return match_topic(topic, graph, [scheme]).missing


@pytest.mark.parametrize(
    ("token", "scheme", "node"),
    [
        # Jazzy and Kilted
        (f"{HEAD}/1/MS/%/%/nav/%speed_limit/{TYPE}/{HASH}/::,10:,:,:,,", KeyScheme.HASHED, "/nav"),
        # Lyrical may add the transport of large messages at the end
        (
            f"{HEAD}/1/MS/%/%/nav/%speed_limit/{TYPE}/{HASH}/::,1:,:,:,,/cpu",
            KeyScheme.HASHED,
            "/nav",
        ),
        # Humble
        (
            f"{HEAD}/11/MS/%/%r1/nav/%speed_limit/{TYPE}/{NO_HASH}/2::,5:,:,:,,",
            KeyScheme.UNHASHED,
            "/r1/nav",
        ),
    ],
)
def test_tokens_of_rmw_zenoh(token: str, scheme: KeyScheme, node: str) -> None:
    endpoint = endpoint_of(token)
    assert (endpoint.entity, endpoint.topic, endpoint.kind) == (
        SUBSCRIPTION,
        "/speed_limit",
        SPEED_LIMIT,
    )
    assert (endpoint.scheme, endpoint.node, endpoint.domain) == (scheme, node, 0)


def test_tokens_of_the_bridge() -> None:
    token = f"@/a1b2/@ros2_lv/MS/r1§speed_limit/nav2_msgs§msg§SpeedLimit/:1:0:0,10:typehash={HASH};"
    endpoint = endpoint_of(token)
    assert (endpoint.topic, endpoint.kind) == ("/r1/speed_limit", SPEED_LIMIT)
    assert (endpoint.scheme, endpoint.domain) == (KeyScheme.BRIDGED, None)
    ours = Identity(0, "a1b2", "/", "n").bridged_token(
        SUBSCRIPTION, "/r1/speed_limit", SPEED_LIMIT, HASH
    )
    assert ours == token


def test_own_tokens_are_read() -> None:
    us = Identity(7, "ab", "/fleet/r1", "slopewise")
    node = endpoint_of(us.node_token())
    assert node == Endpoint(NODE, 7, "ab", "/fleet/r1/slopewise")
    endpoint = endpoint_of(us.token(3, PUBLISHER, "/fleet/r1/plan", PATH, "RIHS01_0"))
    assert endpoint == Endpoint(
        PUBLISHER, 7, "ab", "/fleet/r1/slopewise", "/fleet/r1/plan", PATH, "RIHS01_0"
    )


@pytest.mark.parametrize(
    "token", ["", "a", "@ros2_lv", f"{HEAD}/1/MS/%/%", "@/a/@ros2_lv", "@ros2_lv/x/a/0/0/NN/%/%/n"]
)
def test_other_text_is_not_a_token(token: str) -> None:
    assert endpoint_of(token) is None


def test_subscription_under_a_known_hash_matches() -> None:
    for type_hash in (HASH, NULL_HASH):
        assert not missing(subscription(type_hash))
    assert not missing(subscription(NO_HASH), scheme=KeyScheme.UNHASHED)
    assert not missing(subscription("", domain=None), scheme=KeyScheme.BRIDGED)


def test_grid_map_under_either_hash_matches() -> None:
    kind = "grid_map_msgs/msg/GridMap"
    topic = OwnTopic("/m", kind, SUBSCRIPTION)
    for type_hash in type_hashes(kind):
        there = Endpoint(PUBLISHER, 0, "ab", "/mapper", "/m", kind, type_hash)
        assert not missing(there, topic=topic)


@pytest.mark.parametrize(
    ("endpoints", "cause"),
    [
        ((), "no node of ROS 2 is seen at all"),
        ((Endpoint(NODE, 5, "ab", "/nav"),), "others are in ROS_DOMAIN_ID 5, we are in 0"),
        ((Endpoint(NODE, 0, "ab", "/nav"),), "1 nodes are seen, and none of them has the topic"),
        ((subscription("RIHS01_77"),), "/controller_server has it under another hash, RIHS01_77"),
        ((subscription(NO_HASH),), "of Humble does; set ros.distribution"),
        ((subscription(kind=PATH),), "has it as nav_msgs/msg/Path"),
        ((subscription(topic="/r1/speed_limit"),), "has /r1/speed_limit instead: another namesp"),
        ((subscription(topic="/limits"),), "others have that type on /limits"),
    ],
)
def test_missing_match_has_a_cause(endpoints: tuple[Endpoint, ...], cause: str) -> None:
    text = missing(*endpoints)
    assert text.startswith(f"no node subscribes to /speed_limit with our type, {SPEED_LIMIT}: ")
    assert cause in text
