"""Messages of one topic, or one type, out of a ROS 2 recording (sqlite3 or MCAP), without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slopewise.services.io.access import fault, reason
from slopewise.services.io.bags.ros_types import read_cdr, typestore

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


@dataclass(frozen=True, slots=True)
class Bag:
    """An open recording.

    Attributes:
        path: of it. reader: of rosbags. types: of each topic.
    """

    path: Path
    reader: Any
    types: dict[str, str]

    def topics_of(self, kind: str) -> list[str]:
        """Topics of a type, sorted.

        Raises:
            InputError: there are none; it says what there is.
        """
        found = sorted(topic for topic, other in self.types.items() if other == kind)
        if not found:
            there = ", ".join(f"{topic} ({other})" for topic, other in sorted(self.types.items()))
            words = f"expected a topic of {kind}, got {there or 'nothing'}"
            raise fault(self.path, "topics", words)
        return found

    def messages_of(
        self, topics: Sequence[str], kind: str, *, last: bool = False
    ) -> list[Recorded]:
        """Messages of some topics in the order received.

        Args:
            topics: of type ``kind``, all of them recorded.
            last: only the last message of each topic; the others are not decoded.

        Raises:
            InputError: a topic is missing, of another type, or empty; a message cannot be read.
        """
        for topic in topics:
            if self.types.get(topic) != kind:
                there = ", ".join(sorted(t for t, found in self.types.items() if found == kind))
                words = f"expected one of {kind}, here: {there or 'none'}"
                raise fault(self.path, f"topic {topic}", words)
        here = [c for c in self.reader.connections if c.topic in topics]
        raws: list[tuple[str, int, bytes]] = []
        newest: dict[str, int] = {}
        for connection, at, raw in self.raw(here):
            if last and connection.topic in newest:
                raws[newest[connection.topic]] = (connection.topic, at, bytes(raw))
                continue
            newest[connection.topic] = len(raws)
            raws.append((connection.topic, at, bytes(raw)))
        for topic in topics:
            if topic not in newest:
                raise fault(self.path, f"topic {topic}", "expected messages, got none")
        return [
            Recorded(topic, at, read_cdr(raw, kind, self.path, f"topic {topic}"))
            for topic, at, raw in raws
        ]

    def raw(self, connections: list[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """All messages as bytes; whatever is wrong with the file is said in one line."""
        messages = self.reader.messages(connections)
        while True:
            try:
                one = next(messages)
            except StopIteration:
                return
            except Exception as error:  # noqa: BLE001 - of rosbags, of decompressors, of sqlite
                words = f"expected an intact recording, got: {reason(error)}"
                raise fault(self.path, "", words) from None
            yield one


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """A recording to read from.

    Raises:
        InputError: no recording.
    """
    if not path.exists():
        raise fault(path, "", "expected an existing file or folder")
    store = typestore()
    from rosbags.highlevel import AnyReader

    with ExitStack() as stack:
        try:
            made = AnyReader([folder_of(path) or path], default_typestore=store)
            reader = stack.enter_context(made)
        except Exception as error:  # noqa: BLE001 - a length in a broken file may lead anywhere
            raise fault(path, "", f"expected a ROS 2 recording, got: {reason(error)}") from None
        yield Bag(path, reader, {c.topic: c.msgtype for c in reader.connections})


def state_of(path: Path) -> tuple[tuple[str, int, int], ...]:
    """What changes whenever the files of a recording do: names, times and sizes."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    stats = [(file.name, file.stat()) for file in files if file.is_file()]
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
