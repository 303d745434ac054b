"""ROS 2 message types without ROS: those of rosbags, and the few that it does not know.

`grid_map_msgs/GridMap` exists in two definitions: with the header first, as ROS 2 has it, and with
the header inside `info`, as ROS 1 and ports of it have it. Their bytes are the same, their type
hashes differ.
"""

from __future__ import annotations

import struct
from dataclasses import fields, is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from slopewise.models.errors import InputError
from slopewise.services.io.access import fault

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

GRID_MAP = "grid_map_msgs/msg/GridMap"
PATH = "nav_msgs/msg/Path"
SPEED_LIMIT = "nav2_msgs/msg/SpeedLimit"

_ENCAPSULATION = 4
_WORD, _WIDEST = 4, 8
_GRID_MAP_INFO = "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose\n"
_GRID_MAP = (
    "grid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
    "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index\n"
)
_HEADER = "std_msgs/Header header\n"
_SPEED_LIMIT = _HEADER + "bool percentage\nfloat64 speed_limit\n"


@cache
def typestore(header_in_info: bool = False) -> Typestore:
    """Types of ROS 2 Jazzy with grid maps and Nav2's speed limit; shared, nobody registers more.

    Args:
        header_in_info: grid maps in their older definition.

    Raises:
        InputError: rosbags is not installed.
    """
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
    """Hashes (RIHS01) that a type goes by; the first is the one to publish under.

    They are the same in Jazzy, Kilted and Lyrical, because none of the types has changed since.
    """
    hashes = [typestore(older).hash_rihs01(kind) for older in (False, True)]
    return tuple(dict.fromkeys(hashes))


def read_cdr(raw: Any, kind: str, source: object, where: str) -> Any:
    """A message out of its bytes, complete, with nothing behind it but padding.

    Args:
        raw: CDR with its encapsulation, anything that ``bytes`` takes.
        kind: e.g. ``nav_msgs/msg/Path``.
        source: file or key, and ``where`` in it, for errors.

    Raises:
        InputError: these bytes are not exactly one such message. rosbags itself lets up to three
            bytes of any kind follow.
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
    """Whether bytes behind a message that ends at ``end`` are what serialisers append.

    DDS appends zeros, up to the widest alignment. rclpy hands out as many bytes as it reserved,
    with whatever was in them: up to a multiple of four, and four more for each empty sequence of
    eight-byte numbers, whose alignment it counts and does not write.
    """
    if len(rest) < _WIDEST and not any(rest):
        return True
    filled = len(rest) % _WORD == -end % _WORD
    return filled and len(rest) < _WORD * (1 + _empty_sequences(message))


def _empty_sequences(value: Any) -> int:
    if isinstance(value, np.ndarray):
        return int(value.size == 0 and value.itemsize == _WIDEST)
    if isinstance(value, list):
        return sum(_empty_sequences(item) for item in value)
    if not is_dataclass(value):
        return 0
    return sum(_empty_sequences(getattr(value, field.name)) for field in fields(value))
