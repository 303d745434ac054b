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
