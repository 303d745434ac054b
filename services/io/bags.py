"""ROS 2 recordings (sqlite3 or MCAP) and message types, without ROS.

`grid_map_msgs/GridMap` exists in two definitions: with the header first, as ROS 2 has it, and with
the header inside `info`, as ROS 1 and ports of it have it. Their bytes are the same, their type
hashes differ.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.errors import InputError
from slopewise.services.io.files import fault, reason

SUFFIXES = (".mcap", ".db3")

GRID_MAP = "grid_map_msgs/msg/GridMap"
ODOMETRY = "nav_msgs/msg/Odometry"
PATH = "nav_msgs/msg/Path"
SPEED_LIMIT = "nav2_msgs/msg/SpeedLimit"

_ENCAPSULATION = 4  # bytes
_ALIGNMENT, _MAX_ALIGNMENT = 4, 8
"""Bytes of the header of CDR, and alignments of its numbers (OMG DDSI-RTPS, 10)."""

_GRID_MAP_INFO = "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose\n"
_GRID_MAP = (
    "grid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
    "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index\n"
)
_HEADER = "std_msgs/Header header\n"
_SPEED_LIMIT = _HEADER + "bool percentage\nfloat64 speed_limit\n"


@cache
def typestore(header_in_info: bool = False) -> Any:
    """Message types of ROS 2 Jazzy, grid maps and Nav2's speed limit: shared, never extended."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        hint = "expected rosbags for messages of ROS 2, got none: pip install '.[ros]' in a clone"
        raise InputError("rosbags", "", hint) from None
    store = get_typestore(Stores.ROS2_JAZZY)
    outside, inside = ("", _HEADER) if header_in_info else (_HEADER, "")
    store.register(
        {
            **get_types_from_msg(inside + _GRID_MAP_INFO, "grid_map_msgs/msg/GridMapInfo"),
            **get_types_from_msg(outside + _GRID_MAP, GRID_MAP),
            **get_types_from_msg(_SPEED_LIMIT, SPEED_LIMIT),
        }
    )
    return store


@cache
def type_hashes(kind: str) -> tuple[str, ...]:
    """Hashes (RIHS01) of a type; the first is the one to publish under.

    They are the same in Jazzy, Kilted and Lyrical, because none of the types has changed since.
    """
    hashes = [typestore(older).hash_rihs01(kind) for older in (False, True)]
    return tuple(dict.fromkeys(hashes))


def read_cdr(raw: Any, kind: str, source: object, where: str) -> Any:
    """A complete message of a type from CDR with its encapsulation, with only padding behind it.

    rosbags itself lets up to three bytes of any kind follow.
    """
    from rosbags.serde import SerdeError

    data = bytes(raw)
    if len(data) < _ENCAPSULATION or data[:2] not in (b"\x00\x00", b"\x00\x01"):
        raise fault(source, where, f"expected {kind} in CDR, got {len(data)} other bytes")
    store = typestore()
    definition = store.get_msgdef(kind)
    read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
    body = data[_ENCAPSULATION:]
    try:
        message, end = read(body, 0, definition.cls, store)
    except (SerdeError, struct.error, ValueError, IndexError, MemoryError) as error:
        raise fault(source, where, f"expected {kind}, got something cut off: {error}") from None
    if end > len(body):
        raise fault(source, where, f"expected {kind}, got {end - len(body)} bytes too few")
    if not _is_padding(body[end:], end, message):
        raise fault(source, where, f"expected {kind}, got {len(body) - end} bytes after it")
    return message


def _is_padding(rest: bytes, end: int, message: Any) -> bool:
    """Return True if bytes behind a message that ends at ``end`` are what serialisers append.

    DDS appends zeros, up to the widest alignment. rclpy hands out as many bytes as it reserved,
    with arbitrary content: up to a multiple of four, and four more for each empty sequence of
    eight-byte numbers, whose alignment it counts and does not write.
    """
    if len(rest) < _MAX_ALIGNMENT and not any(rest):
        return True
    filled = len(rest) % _ALIGNMENT == -end % _ALIGNMENT
    return filled and len(rest) < _ALIGNMENT * (1 + _empty_sequences(message))


def _empty_sequences(value: Any) -> int:
    if isinstance(value, np.ndarray):
        return int(value.size == 0 and value.itemsize == _MAX_ALIGNMENT)
    if isinstance(value, list):
        return sum(_empty_sequences(item) for item in value)
    if not is_dataclass(value):
        return 0
    return sum(_empty_sequences(getattr(value, field.name)) for field in fields(value))


def attitude(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a unit quaternion, z-y-x order as in REP-103 [rad]."""
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return float(roll), float(pitch), float(yaw)


def is_bag(path: Path) -> bool:
    """Return True if a path is a ROS 2 recording: a file of one, or its folder."""
    return path.suffix.lower() in SUFFIXES or (path / "metadata.yaml").is_file()


def folder_of(path: Path) -> Path | None:
    """The folder of a recording that a file belongs to."""
    inside = path.is_file() and (path.parent / "metadata.yaml").is_file()
    return path.parent if inside else None


@dataclass(frozen=True, slots=True)
class Bag:
    """An open recording."""

    path: Path
    reader: Any
    types: dict[str, str]

    def topics_of(self, kind: str) -> list[str]:
        """Topics of a type, sorted."""
        topics = sorted(topic for topic, given in self.types.items() if given == kind)
        if not topics:
            there = ", ".join(f"{topic} ({given})" for topic, given in sorted(self.types.items()))
            expected = f"expected a topic of {kind}, got {there or 'nothing'}"
            raise fault(self.path, "topics", expected)
        return topics

    def messages_of(
        self, topics: Sequence[str], kind: str, *, last: bool = False
    ) -> list[tuple[str, Any]]:
        """Recorded topics and messages in the order received; maybe only the last of each."""
        for topic in topics:
            if self.types.get(topic) != kind:
                there = ", ".join(sorted(t for t, given in self.types.items() if given == kind))
                expected = f"expected one of {kind}, here: {there or 'none'}"
                raise fault(self.path, f"topic {topic}", expected)
        here = [c for c in self.reader.connections if c.topic in topics]
        raws: dict[object, tuple[str, bytes]] = {}
        for number, (connection, _, raw) in enumerate(self.raw(here)):
            topic = connection.topic
            raws[topic if last else number] = topic, bytes(raw)
        recorded = {topic for topic, _ in raws.values()}
        for topic in topics:
            if topic not in recorded:
                raise fault(self.path, f"topic {topic}", "expected messages, got none")
        return [
            (topic, read_cdr(raw, kind, self.path, f"topic {topic}"))
            for topic, raw in raws.values()
        ]

    def raw(self, connections: list[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """All messages as bytes; a fault of the file is reported in one line."""
        try:
            yield from self.reader.messages(connections)
        except Exception as error:  # noqa: BLE001 - of rosbags, of decompressors, of sqlite
            expected = f"expected an intact recording, got: {reason(error)}"
            raise fault(self.path, "", expected) from None

    def decoded(self, connection: Any, raw: Any) -> Any:
        """A message by the definition that the recording itself has."""
        try:
            return self.reader.deserialize(raw, connection.msgtype)
        except Exception as error:  # noqa: BLE001 - of rosbags, or of broken bytes in it
            expected = f"expected {connection.msgtype}, got: {reason(error)}"
            raise fault(self.path, f"topic {connection.topic}", expected) from None


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """A recording to read from."""
    if not path.exists():
        raise fault(path, "", "expected an existing file or folder")
    store = typestore()
    from rosbags.highlevel import AnyReader

    with ExitStack() as stack:
        try:
            any_reader = AnyReader([folder_of(path) or path], default_typestore=store)
            reader = stack.enter_context(any_reader)
        except Exception as error:  # noqa: BLE001 - a length in a broken file may lead anywhere
            cut = "; if it was cut off, `mcap recover` keeps what was recorded"
            hint = cut if "magic" in str(error) else ""
            raise fault(
                path, "", f"expected a ROS 2 recording, got: {reason(error)}{hint}"
            ) from None
        yield Bag(path, reader, {c.topic: c.msgtype for c in reader.connections})


def state_of(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Names, times and sizes of the files of a recording: they change whenever the files do."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    stats = [(file.name, file.stat()) for file in files if file.is_file()]
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
