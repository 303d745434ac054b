"""The second copy of the store: the newest state of every group, in a separate file.

It is written whole and renamed over the one before, so that a process that dies meanwhile leaves
that one. It is read where the store is lost.
"""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import msgspec

from slopewise.services.parameters.stored_change import StoredChange


class StoreCopy(msgspec.Struct, frozen=True):
    """Newest change of each group and vehicle; last sequence number of each source."""

    changes: list[StoredChange]
    seen: dict[str, int]


def copy_path(store: Path) -> Path:
    """Where the copy of a store is."""
    return store.with_name(store.name + "-last")


def write_copy(store: Path, copy: StoreCopy) -> None:
    """Write the copy of a store to disk."""
    body = msgspec.msgpack.encode(copy)
    path = copy_path(store)
    fresh = path.with_name(path.name + ".new")
    with fresh.open("wb") as file:
        file.write(zlib.crc32(body).to_bytes(4, "little") + body)
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


def read_copy(store: Path) -> StoreCopy | None:
    """The copy of a store; None if it is missing or damaged."""
    try:
        data = copy_path(store).read_bytes()
        if zlib.crc32(data[4:]).to_bytes(4, "little") != data[:4]:
            return None
        return msgspec.msgpack.decode(data[4:], type=StoreCopy)
    except (OSError, msgspec.MsgspecError):
        return None
