"""Results on disk: an interrupted campaign goes on where it was.

What is kept is named by everything that it came from, so that nothing old is ever taken for new:
the sources of benchmark, planner and laws, and what else the benchmark names.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")

_BENCHMARKS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class KeptPickles:
    """Results of one kind of work, a file each; it unpickles what is there, so the folder must be
    one's own.

    Attributes:
        folder: made when something is put into it.
    """

    folder: Path

    def find(self, number: int) -> Any | None:
        """What was put in for a job, None if nothing was."""
        file = self._file(number)
        return pickle.loads(file.read_bytes()) if file.exists() else None

    def put(self, number: int, result: Any) -> None:
        """Keep a result, all or nothing."""
        file = self._file(number)
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(result))
        partial.replace(file)

    def _file(self, number: int) -> Path:
        return self.folder / f"{number}.pkl"


@dataclass(frozen=True, slots=True)
class KeptLines:
    """Lines of several processes in one file."""

    file: Path

    def lines(self) -> list[bytes]:
        """All of them; the last one may be cut off by an interruption."""
        return self.file.read_bytes().split(b"\n") if self.file.exists() else []

    def decoded(self, kind: type[T]) -> Iterator[T]:
        """What they hold; a line that an interruption cut off holds nothing."""
        import msgspec

        for line in self.lines():
            with suppress(msgspec.DecodeError):
                yield msgspec.json.decode(line, type=kind)

    def append(self, line: bytes) -> None:
        """Add a line, with its own end or beginning."""
        # One write at the end of the file: lines of several processes do not mix.
        number = os.open(self.file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            os.write(number, line)
        finally:
            os.close(number)


@cache
def digest_of_sources(parts: Sequence[str], showing: Collection[str], *origins: str) -> str:
    """Digest of what results come from.

    Args:
        parts: folders and files of the benchmarks (``benchmarks/…``) and of the packages.
        showing: files there that only show results.
        origins: what results depend on beside sources, by their representation.
    """
    digest = hashlib.sha256(repr(origins).encode())
    for part in parts:
        own = part.startswith("benchmarks/")
        place = (_BENCHMARKS.parent if own else _packages()) / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            if file.name not in showing:
                digest.update(f"{part}/{file.relative_to(place)}".encode() + file.read_bytes())
    return digest.hexdigest()


def _packages() -> Path:
    """The folder in which models and planner are."""
    from slopewise import models

    return Path(models.__file__).resolve().parents[1]
