"""Messages of one topic, or one type, out of a ROS 2 recording (sqlite3 or MCAP), without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from services.io.access import fault, reason
from services.io.bags.ros_types import read_cdr, typestore

SUFFIXES = (".mcap", ".db3")


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message, and when it was received [ns since 1970]."""

    topic: str
    at: int
    message: Any


def is_bag(path: Path) -> bool:
    """A ROS 2 recording: a file of one, or its folder."""
    return path.suffix.lower() in SUFFIXES or (path / "metadata.yaml").is_file()


def folder_of(path: Path) -> Path | None:
    """The folder of a recording that a file belongs to."""
    inside = path.is_file() and (path.parent / "metadata.yaml").is_file()
    return path.parent if inside else None


@contextmanager
def _open(path: Path) -> Iterator[Any]:
    store = typestore()
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.rosbag2 import ReaderError

    try:
        with AnyReader([folder_of(path) or path], default_typestore=store) as reader:
            yield reader
    except (AnyReaderError, ReaderError, OSError) as error:
        raise fault(path, "", f"expected a ROS 2 recording, got: {reason(error)}") from None


def types_of(path: Path) -> dict[str, str]:
    """Type of each topic.

    Raises:
        InputError: no recording.
    """
    with _open(path) as reader:
        return {c.topic: c.msgtype for c in reader.connections}


def topics_of(path: Path, kind: str) -> list[str]:
    """Topics of a type, sorted.

    Raises:
        InputError: no recording, or none of that type; then it says what there is.
    """
    types = types_of(path)
    found = sorted(topic for topic, other in types.items() if other == kind)
    if not found:
        there = ", ".join(f"{topic} ({other})" for topic, other in sorted(types.items()))
        words = f"expected a topic of {kind}, got {there or 'nothing'}"
        raise fault(path, "topics", words)
    return found


def messages_of(
    path: Path, topics: Sequence[str], kind: str, *, last: bool = False
) -> list[Recorded]:
    """Messages of some topics in the order received.

    Args:
        path: recording. topics: of type ``kind``, all of them recorded.
        last: only the last message of each topic; the others are not decoded.

    Raises:
        InputError: a topic is missing, of another type, or empty; a message cannot be read.
    """
    raws: list[tuple[str, int, bytes]] = []
    with _open(path) as reader:
        types = {c.topic: c.msgtype for c in reader.connections}
        for topic in topics:
            if types.get(topic) != kind:
                there = ", ".join(sorted(t for t, found in types.items() if found == kind))
                words = f"expected one of {kind}, here: {there or 'none'}"
                raise fault(path, f"topic {topic}", words)
        here = [c for c in reader.connections if c.topic in topics]
        newest: dict[str, int] = {}
        for connection, at, raw in reader.messages(here):
            if last and connection.topic in newest:
                raws[newest[connection.topic]] = (connection.topic, at, bytes(raw))
                continue
            newest[connection.topic] = len(raws)
            raws.append((connection.topic, at, bytes(raw)))
    for topic in topics:
        if topic not in newest:
            raise fault(path, f"topic {topic}", "expected messages, got none")
    return [
        Recorded(topic, at, read_cdr(raw, kind, path, f"topic {topic}", padded=True))
        for topic, at, raw in raws
    ]
