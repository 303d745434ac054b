"""Samples of the last stops on disk: one file per stop; damaged files are quarantined.

A file is a checksum and a message in MessagePack, written all or nothing. Its number grows from
stop to stop, with any setting of the clock.
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
_QUARANTINED = ".damaged"
_MAX_QUARANTINED = 3
"""Damaged files that stay for an operator to inspect [1]."""

_MAX_BYTES = 64_000_000  # largest file that is decoded [B], far above any stop
_CHECK = 4  # size of the checksum at the beginning [B]


class StoredStop(Message, frozen=True):
    """One stop with its samples."""

    source: Text  # sender
    surface: Text  # its terrain, empty where unknown
    at: float  # wall clock [s]
    vehicle: Text  # vehicle, model: fingerprints of the vehicle and of the model planned with then
    model: Text
    columns: Annotated[list[Text], Meta(min_length=4, max_length=32)]  # names of the rows
    values: np.ndarray  # (rows, n)


class StopStore:
    """Folder of stops; one process writes to it."""

    def __init__(self, folder: Path, max_bytes: int, counters: Counter[str]) -> None:
        """Open it, or create it; ``counters``: of stops kept and damaged."""
        self.folder, self._max_bytes, self.counters = folder, max_bytes, counters
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._sizes = {path.name: path.stat().st_size for path in _files(folder)}
        except OSError as error:
            raise fault(folder, "", f"expected a folder to write to: {reason(error)}") from None
        self._next = 1 + max((int(name[:12]) for name in self._sizes), default=0)
        self._evict()

    def __len__(self) -> int:
        return len(self._sizes)

    def put(self, stop: StoredStop) -> None:
        """Store a stop; the oldest are deleted at the limit."""
        content = codec.encode(stop, Format.MESSAGEPACK)
        content = zlib.crc32(content).to_bytes(_CHECK, "little") + content
        name = f"{self._next:012d}.stop"
        write_atomic(self.folder / name, content)
        self._next += 1
        self._sizes[name] = len(content)
        self.counters["stops_kept"] += 1
        self._evict()

    def latest(self, count: int) -> list[str]:
        """Names of the last stops, oldest first."""
        return sorted(self._sizes)[-count:]

    def quarantine(self, names: Sequence[str]) -> None:
        """Rename damaged files; the last few stay to be inspected."""
        for name in names:
            if self._sizes.pop(name, None) is None:
                continue
            self.counters["stops_damaged"] += 1
            with contextlib.suppress(OSError):
                (self.folder / name).replace(self.folder / f"{name}{_QUARANTINED}")
        quarantined = sorted(self.folder.glob(f"*{_QUARANTINED}"))
        for path in quarantined[:-_MAX_QUARANTINED]:
            with contextlib.suppress(OSError):
                path.unlink()

    def _evict(self) -> None:
        for name in sorted(self._sizes):
            if sum(self._sizes.values()) <= self._max_bytes:
                return
            with contextlib.suppress(OSError):
                (self.folder / name).unlink(missing_ok=True)
            # One that cannot be deleted is found again by the next start.
            del self._sizes[name]


def read_stop(path: Path) -> StoredStop:
    """A stored stop."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise fault(path.name, "", f"expected a readable file: {reason(error)}") from None
    check, payload = content[:_CHECK], content[_CHECK:]
    if len(check) < _CHECK or zlib.crc32(payload) != int.from_bytes(check, "little"):
        raise fault(path.name, "", "expected a whole file, its checksum does not fit")
    encoding = codec.encoding_of(StoredStop, Format.MESSAGEPACK)
    stop = codec.decode(StoredStop, payload, encoding, path.name, _MAX_BYTES)
    if stop.values.ndim != 2 or len(stop.values) != len(stop.columns):
        raise fault(path.name, "values", f"expected {len(stop.columns)} rows of samples")
    return stop


def read_stops(folder: Path, names: Sequence[str]) -> tuple[list[StoredStop], list[str], str]:
    """Stops, names of damaged ones, and a fingerprint of those read; deleted ones are skipped."""
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
