"""Keys, tokens, attachments and settings of the edge, against what rmw_zenoh's design gives."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from slopewise.models.errors import ParameterError
from slopewise.services.ros import naming
from slopewise.services.ros.settings import EdgeSettings, read_settings

SHIPPED = Path(__file__).parents[3] / "configs" / "ros.toml"
STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_the_keys_of_the_design_document() -> None:
    assert naming.topic_key(0, "/chatter", "std_msgs/msg/String", STRING) == (
        f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
    )
    name = naming.full_name("/robot1", "chatter")
    assert naming.topic_key(2, name, "std_msgs/msg/String", "*") == (
        "2/robot1/chatter/std_msgs::msg::dds_::String_/*"
    )


def test_the_tokens_of_the_design_document() -> None:
    listener = naming.Identity(2, "aac3178e146ba6f1fc6e6a4085e77f21", "/", "listener")
    assert listener.node_token() == (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
    )
    assert listener.token(10, naming.SUBSCRIPTION, "/chatter", "std_msgs/msg/String", STRING) == (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,"
    )
    inside = naming.Identity(0, "ab", "/fleet/robot1", "n")
    assert inside.node_token() == "@ros2_lv/0/ab/0/0/NN/%/%fleet%robot1/n"


def test_the_hash_of_a_string_is_that_of_the_design_document() -> None:
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    from slopewise.services.io.bags import type_hashes

    assert type_hashes("std_msgs/msg/String") == (STRING,)


def test_attachments() -> None:
    sent = naming.Attachment(7, 1_800_000_000_000_000_123, naming.gid_of("token"))
    data = sent.encode()
    assert struct.unpack("<qqB16s", data) == (7, sent.at, 16, sent.gid)
    assert naming.read_attachment(data) == sent
    for wrong in (b"", data[:-1], data + b"\0", data[:16] + b"\x11" + data[17:]):
        with pytest.raises(ParameterError, match="bytes"):
            naming.read_attachment(wrong)
    assert naming.gid_of("a") != naming.gid_of("b")


@pytest.mark.parametrize("name", ["", "/", "a b", "1a", "a//b", "/a/", "a/ü", "a*"])
def test_names_that_ros_does_not_have(name: str) -> None:
    with pytest.raises(ParameterError):
        naming.full_name("/", name)


def test_the_shipped_settings_are_the_defaults() -> None:
    assert read_settings(SHIPPED) == EdgeSettings()
