"""Samples of the last stops on disk: a file a stop, the oldest out, damaged ones put aside.

A file is a checksum and a message in MessagePack, written all or nothing. Its number grows from
stop to stop, whatever clocks do.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from slopewise.models.errors import InputError
from slopewise.services.io.files import fault, reason, write_atomic
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import Message, Text

_NAME = re.compile(r"(\d{12})\.stop")
_ASIDE = ".damaged"
_KEPT_ASIDE = 3
_LARGEST = 64_000_000
_CHECK = 4  # bytes of the checksum in front


class StoredStop(Message, frozen=True):
    """One stop with its samples.

    Attributes:
        source: who drove. surface: what on, empty where nobody knows. at: clock of the day [s].
        vehicle, model: fingerprints of the vehicle and of the model planned with then.
        columns: names of the rows. values: (rows, n).
    """

    source: Text
    surface: Text
    at: float
    vehicle: Text
    model: Text
    columns: Annotated[list[Text], Meta(min_length=4, max_length=32)]
    values: np.ndarray


class StopStore:
    """A folder of stops; one process writes to it.

    Attributes:
        counters: stops kept, lost, damaged.
    """

    def __init__(self, folder: Path, most_bytes: int) -> None:
        """Open it, and create it where it is missing.

        Raises:
            InputError: the folder cannot be used.
        """
        self.folder, self._most_bytes = folder, most_bytes
        self.counters: Counter[str] = Counter()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._sizes = {path.name: path.stat().st_size for path in _files(folder)}
        except OSError as error:
            raise fault(folder, "", f"expected a folder to write to: {reason(error)}") from None
        self._next = 1 + max((int(name[:12]) for name in self._sizes), default=0)
        self._make_room()

    def __len__(self) -> int:
        return len(self._sizes)

    def put(self, stop: StoredStop) -> None:
        """Keep a stop; the oldest make room.

        Raises:
            InputError: it cannot be written; what is there stays as it is.
        """
        content = codec.encode(stop, Format.MESSAGEPACK)
        content = zlib.crc32(content).to_bytes(_CHECK, "little") + content
        name = f"{self._next:012d}.stop"
        write_atomic(self.folder / name, content)
        self._next += 1
        self._sizes[name] = len(content)
        self.counters["stops_kept"] += 1
        self._make_room()

    def latest(self, most: int) -> list[str]:
        """Names of the last stops, oldest first."""
        return sorted(self._sizes)[-most:]

    def put_aside(self, names: Sequence[str]) -> None:
        """Take damaged files out of the way; a few are kept to be looked at."""
        for name in names:
            if self._sizes.pop(name, None) is None:
                continue
            self.counters["stops_damaged"] += 1
            with contextlib.suppress(OSError):
                (self.folder / name).replace(self.folder / f"{name}{_ASIDE}")
        aside = sorted(self.folder.glob(f"*{_ASIDE}"))
        for path in aside[:-_KEPT_ASIDE]:
            with contextlib.suppress(OSError):
                path.unlink()

    def _make_room(self) -> None:
        for name in sorted(self._sizes):
            if sum(self._sizes.values()) <= self._most_bytes:
                return
            with contextlib.suppress(OSError):
                (self.folder / name).unlink(missing_ok=True)
            # One that cannot be deleted is not counted twice: the next start finds it again.
            del self._sizes[name]


def read_stop(path: Path) -> StoredStop:
    """A stop that was kept.

    Raises:
        InputError: damaged, or it cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise fault(path.name, "", f"expected a readable file: {reason(error)}") from None
    check, payload = content[:_CHECK], content[_CHECK:]
    if len(check) < _CHECK or zlib.crc32(payload) != int.from_bytes(check, "little"):
        raise fault(path.name, "", "expected a whole file, its checksum does not fit")
    encoding = codec.encoding_of(StoredStop, Format.MESSAGEPACK)
    stop = codec.decode(StoredStop, payload, encoding, path.name, _LARGEST)
    if stop.values.ndim != 2 or len(stop.values) != len(stop.columns):
        raise fault(path.name, "values", f"expected {len(stop.columns)} rows of samples")
    return stop


def read_stops(folder: Path, names: Sequence[str]) -> tuple[list[StoredStop], list[str], str]:
    """Stops, names of damaged ones, and a fingerprint of those read.

    Files that are gone by now made room for others: they are left out.
    """
    stops: list[StoredStop] = []
    damaged: list[str] = []
    digest = hashlib.sha256()
    for name in names:
        if not (folder / name).exists():
            continue
        try:
            stop = read_stop(folder / name)
        except InputError:
            damaged.append(name)
            continue
        stops.append(stop)
        digest.update(np.ascontiguousarray(stop.values).tobytes())
        digest.update(f"{stop.columns}{stop.surface}".encode())
    return stops, damaged, digest.hexdigest()[:12]


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if _NAME.fullmatch(path.name))
