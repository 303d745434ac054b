"""Tokens of every distribution, and what silence is put down to."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.io.bags import PATH, SPEED_LIMIT, type_hashes
from slopewise.services.ros.audience import OwnTopic, audience_of
from slopewise.services.ros.graph import Endpoint, Speech, endpoint_of
from slopewise.services.ros.naming import (
    NO_HASH,
    NODE,
    NULL_HASH,
    PUBLISHER,
    SUBSCRIPTION,
    Identity,
)

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


class Others:
    """A graph of given endpoints."""

    def __init__(self, *endpoints: Endpoint) -> None:
        self.domain, self._all = 0, list(endpoints)

    def all(self) -> list[Endpoint]:
        return self._all

    def here(self) -> list[Endpoint]:
        return [e for e in self._all if e.domain in (0, None) and e.entity != NODE]


def missing(*endpoints: Endpoint, line: OwnTopic = LIMIT, speech: Speech = Speech.HASHED) -> str:
    others: Any = Others(*endpoints)
    return audience_of(line, others, [speech]).missing


@pytest.mark.parametrize(
    ("token", "speech", "node"),
    [
        # Jazzy and Kilted
        (f"{HEAD}/1/MS/%/%/nav/%speed_limit/{TYPE}/{HASH}/::,10:,:,:,,", Speech.HASHED, "/nav"),
        # Lyrical may say at the end how large messages are carried
        (f"{HEAD}/1/MS/%/%/nav/%speed_limit/{TYPE}/{HASH}/::,1:,:,:,,/cpu", Speech.HASHED, "/nav"),
        # Humble
        (
            f"{HEAD}/11/MS/%/%r1/nav/%speed_limit/{TYPE}/{NO_HASH}/2::,5:,:,:,,",
            Speech.UNHASHED,
            "/r1/nav",
        ),
    ],
)
def test_tokens_of_rmw_zenoh(token: str, speech: Speech, node: str) -> None:
    found = endpoint_of(token)
    assert found is not None
    assert (found.entity, found.topic, found.kind) == (SUBSCRIPTION, "/speed_limit", SPEED_LIMIT)
    assert (found.speech, found.node, found.domain) == (speech, node, 0)


def test_tokens_of_the_bridge() -> None:
    token = f"@/a1b2/@ros2_lv/MS/r1§speed_limit/nav2_msgs§msg§SpeedLimit/:1:0:0,10:typehash={HASH};"
    found = endpoint_of(token)
    assert found is not None
    assert (found.topic, found.kind) == ("/r1/speed_limit", SPEED_LIMIT)
    assert (found.speech, found.domain) == (Speech.BRIDGED, None)
    ours = Identity(0, "a1b2", "/", "n").bridged_token(
        SUBSCRIPTION, "/r1/speed_limit", SPEED_LIMIT, HASH
    )
    assert ours == token


def test_our_own_tokens_are_understood() -> None:
    us = Identity(7, "ab", "/fleet/r1", "slopewise")
    node = endpoint_of(us.node_token())
    assert node == Endpoint(NODE, 7, "ab", "/fleet/r1/slopewise")
    found = endpoint_of(us.token(3, PUBLISHER, "/fleet/r1/plan", PATH, "RIHS01_0"))
    assert found == Endpoint(
        PUBLISHER, 7, "ab", "/fleet/r1/slopewise", "/fleet/r1/plan", PATH, "RIHS01_0"
    )


@pytest.mark.parametrize(
    "token", ["", "a", "@ros2_lv", f"{HEAD}/1/MS/%/%", "@/a/@ros2_lv", "@ros2_lv/x/a/0/0/NN/%/%/n"]
)
def test_what_is_no_token(token: str) -> None:
    assert endpoint_of(token) is None


def test_who_hears_us() -> None:
    for type_hash in (HASH, NULL_HASH):
        assert not missing(subscription(type_hash))
    assert not missing(subscription(NO_HASH), speech=Speech.UNHASHED)
    assert not missing(subscription("", domain=None), speech=Speech.BRIDGED)


def test_grid_maps_are_heard_under_either_hash() -> None:
    kind = "grid_map_msgs/msg/GridMap"
    line = OwnTopic("/m", kind, SUBSCRIPTION)
    for type_hash in type_hashes(kind):
        there = Endpoint(PUBLISHER, 0, "ab", "/mapper", "/m", kind, type_hash)
        assert not missing(there, line=line)


@pytest.mark.parametrize(
    ("endpoints", "words"),
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
def test_silence_has_a_cause(endpoints: tuple[Endpoint, ...], words: str) -> None:
    said = missing(*endpoints)
    assert said.startswith(f"nobody subscribes to /speed_limit with our type, {SPEED_LIMIT}: ")
    assert words in said
