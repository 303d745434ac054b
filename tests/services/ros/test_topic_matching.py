"""Tokens of every distribution, why a topic has no other end, bytes of the real client library.

Those are of rclpy with Fast CDR of Kilted, from the packages of PyPI that `made_by` in their file
has; next to each message are the values that it was made of.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.models.errors import InputError
from slopewise.services.io.bags import PATH, SPEED_LIMIT, read_cdr, type_hashes, typestore
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


DATA: dict[str, Any] = json.loads(
    (Path(__file__).parent / "data" / "rclpy_kilted.json").read_text()
)
MESSAGES: list[dict[str, Any]] = DATA["messages"]


def plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        names = [f.name for f in fields(value) if f.name.islower() and f.name[0] != "_"]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("example", MESSAGES, ids=lambda example: example["type"])
def test_messages_of_rclpy(example: dict[str, Any]) -> None:
    kind, raw = example["type"], bytes.fromhex(example["bytes"])
    message = read_cdr(raw, kind, "rclpy", "")
    assert plain(message) == example["values"]
    ours = bytes(typestore().serialize_cdr(message, kind))
    # Equal except gaps, between numbers and at the end, which Fast CDR does not write.
    differ = [k for k, (a, b) in enumerate(zip(raw, ours, strict=False)) if a != b]
    assert all(ours[k] == 0 for k in differ)
    filled = bytearray(ours)
    for k in differ:
        filled[k] = raw[k]
    assert plain(read_cdr(bytes(filled), kind, "here", "")) == example["values"]
    assert 0 <= len(raw) - len(ours) <= (8 if kind == "sensor_msgs/msg/JointState" else 3)


def test_padding_of_fast_cdr_may_hold_any_bytes() -> None:
    """Both flags are eight bytes long, of which three are padding."""
    flags = [example for example in MESSAGES if example["type"] == "std_msgs/msg/Bool"]
    assert {len(example["bytes"]) for example in flags} == {16}
    for garbage in (b"\x56\0\0", b"\xff\xff\xff", b"\0\0\0"):
        assert read_cdr(b"\0\1\0\0\1" + garbage, "std_msgs/msg/Bool", "here", "").data


@pytest.mark.parametrize("example", MESSAGES, ids=lambda example: example["type"])
def test_padding_is_ignored_and_garbage_is_refused(example: dict[str, Any]) -> None:
    kind = example["type"]
    message = read_cdr(bytes.fromhex(example["bytes"]), kind, "rclpy", "")
    raw = bytes(typestore().serialize_cdr(message, kind))
    gap = -len(raw) % 4
    for padding in (b"", b"\0" * gap, b"\xa5" * gap, b"\0" * 7):
        assert plain(read_cdr(raw + padding, kind, "here", "")) == example["values"]
    max_padding = 16 if kind == "sensor_msgs/msg/JointState" else 8
    for garbage in (b"\x01" * (max_padding + 1), b"\0" * max_padding, b"\1" * (gap + 1)):
        with pytest.raises(InputError, match="after it"):
            read_cdr(raw + garbage, kind, "here", "")
    for cut in (1, 2, 3):
        with pytest.raises(InputError):
            read_cdr(raw[:-cut], kind, "here", "")


@pytest.mark.parametrize("kind", sorted(DATA["hashes"]))
def test_hashes_are_those_of_kilted(kind: str) -> None:
    assert type_hashes(kind)[0] == DATA["hashes"][kind]


@pytest.mark.parametrize("store", ["ROS2_JAZZY", "ROS2_KILTED", "ROS2_LYRICAL"])
def test_hashes_are_the_same_in_all_distributions_that_have_them(store: str) -> None:
    from rosbags.typesys import Stores, get_typestore

    store_of = get_typestore(getattr(Stores, store))
    kinds = [*DATA["hashes"], "tf2_msgs/msg/TFMessage"]
    assert {k: store_of.hash_rihs01(k) for k in kinds} == {k: type_hashes(k)[0] for k in kinds}
