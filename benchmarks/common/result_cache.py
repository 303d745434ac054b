"""Results on disk, from which an interrupted campaign resumes.

A result is named by everything that it depends on: the sources of benchmark, planner and laws, and
all else that the benchmark states. A changed source therefore never meets an old result.
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

import msgspec

T = TypeVar("T")

_BENCHMARKS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class PickleCache:
    """Results by job number, a file each. Files are unpickled: the folder must be trusted.

    Attributes:
        folder: created by the first result.
    """

    folder: Path

    def find(self, number: int) -> Any | None:
        """Return the stored result of a job, None without one."""
        file = self._file(number)
        return pickle.loads(file.read_bytes()) if file.exists() else None

    def put(self, number: int, result: Any) -> None:
        """Store a result atomically."""
        file = self._file(number)
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(result))
        partial.replace(file)

    def _file(self, number: int) -> Path:
        return self.folder / f"{number}.pkl"


@dataclass(frozen=True, slots=True)
class LineCache:
    """JSON lines of several processes in one file."""

    file: Path

    def decode(self, kind: type[T]) -> Iterator[T]:
        """Yield the stored values; a line truncated by an interruption is skipped."""
        for line in self.file.read_bytes().split(b"\n") if self.file.exists() else []:
            with suppress(msgspec.DecodeError):
                yield msgspec.json.decode(line, type=kind)

    def append(self, line: bytes) -> None:
        """Add a line in one write, so that lines of several processes never mix."""
        number = os.open(self.file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            os.write(number, line)
        finally:
            os.close(number)


@cache
def digest_of_sources(parts: Sequence[str], ignored: Collection[str], *origins: str) -> str:
    """Digest of everything that results depend on.

    Args:
        parts: folders and files of the benchmarks (``benchmarks/…``) and of the packages.
        ignored: file names that only present results.
        origins: dependencies that are not sources, by their representation.
    """
    from slopewise import models

    digest = hashlib.sha256(repr(origins).encode())
    packages = Path(models.__file__).resolve().parents[1]
    for part in parts:
        place = (_BENCHMARKS.parent if part.startswith("benchmarks/") else packages) / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            if file.name not in ignored:
                digest.update(f"{part}/{file.relative_to(place)}".encode() + file.read_bytes())
    return digest.hexdigest()
