"""Bytes of the real client library are read and written; see rclpy_messages.py for where from."""

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
from slopewise.services.io.bags import read_cdr, type_hashes, typestore

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


@pytest.mark.parametrize("made", MESSAGES, ids=lambda made: made["type"])
def test_messages_of_rclpy(made: dict[str, Any]) -> None:
    kind, raw = made["type"], bytes.fromhex(made["bytes"])
    message = read_cdr(raw, kind, "rclpy", "")
    assert plain(message) == made["values"]
    ours = bytes(typestore().serialize_cdr(message, kind))
    # Equal but for gaps, between numbers and at the end, which Fast CDR leaves as they were.
    differ = [k for k, (a, b) in enumerate(zip(raw, ours, strict=False)) if a != b]
    assert all(ours[k] == 0 for k in differ)
    filled = bytearray(ours)
    for k in differ:
        filled[k] = raw[k]
    assert plain(read_cdr(bytes(filled), kind, "here", "")) == made["values"]
    assert 0 <= len(raw) - len(ours) <= (8 if kind == "sensor_msgs/msg/JointState" else 3)


def test_fast_cdr_pads_with_whatever_was_in_its_buffer() -> None:
    """Both flags are eight bytes long, of which three mean nothing."""
    flags = [made for made in MESSAGES if made["type"] == "std_msgs/msg/Bool"]
    assert {len(made["bytes"]) for made in flags} == {16}
    for garbage in (b"\x56\0\0", b"\xff\xff\xff", b"\0\0\0"):
        assert read_cdr(b"\0\1\0\0\1" + garbage, "std_msgs/msg/Bool", "here", "").data


@pytest.mark.parametrize("made", MESSAGES, ids=lambda made: made["type"])
def test_padding_is_no_part_of_a_message_and_garbage_is_none(made: dict[str, Any]) -> None:
    kind = made["type"]
    message = read_cdr(bytes.fromhex(made["bytes"]), kind, "rclpy", "")
    raw = bytes(typestore().serialize_cdr(message, kind))
    word = -len(raw) % 4
    for padding in (b"", b"\0" * word, b"\xa5" * word, b"\0" * 7):
        assert plain(read_cdr(raw + padding, kind, "here", "")) == made["values"]
    most = 16 if kind == "sensor_msgs/msg/JointState" else 8
    for garbage in (b"\x01" * (most + 1), b"\0" * most, b"\1" * (word + 1)):
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

    other = get_typestore(getattr(Stores, store))
    kinds = [*DATA["hashes"], "tf2_msgs/msg/TFMessage"]
    assert {k: other.hash_rihs01(k) for k in kinds} == {k: type_hashes(k)[0] for k in kinds}
