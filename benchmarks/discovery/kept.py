"""Outcomes on disk, one line of JSON a set: an interrupted benchmark goes on where it was.

The file is named by the sources that its outcomes came from, so that nothing old is taken for new.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import msgspec

from .catalogue import SetConditions
from .tasks import FinishedSet, SetTask

_SOURCES = (
    "benchmarks/discovery", "models/discrepancy", "models/calibration", "models/effects",
    "models/laws", "models/stop_logs", "models/stops",
)  # fmt: skip
_SHOWING = ("campaign.py", "charts.py", "kept.py", "metrics.py", "tables.py")
"""What only counts and shows outcomes does not change them."""


class Kept:
    """Outcomes of one state of the sources under one set of conditions.

    Args:
        folder: made if it is not there. conditions: of the plant's sets.
    """

    def __init__(self, folder: Path, conditions: SetConditions) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        name = _origin(conditions)
        self.file = folder / f"sets-{name}.jsonl"
        self._promises = folder / f"promises-{name}.txt"

    def find(self) -> dict[SetTask, FinishedSet]:
        """All that was done; a last line that an interruption cut off is none."""
        if not self.file.exists():
            return {}
        found = {}
        for line in self.file.read_bytes().split(b"\n"):
            try:
                done = msgspec.json.decode(line, type=FinishedSet)
            except msgspec.DecodeError:
                continue  # cut off: that set is done again
            found[done.task] = done
        return found

    def put(self, done: FinishedSet) -> None:
        """Append one."""
        _append(self.file, b"\n" + msgspec.json.encode(done))

    def promise(self, digest: str) -> None:
        """Append the digest of a truth, before anything is asked."""
        _append(self._promises, digest.encode() + b"\n")


def _append(file: Path, line: bytes) -> None:
    # One write at the end of the file: lines of several processes do not mix.
    number = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(number, line)
    finally:
        os.close(number)


def _origin(conditions: SetConditions) -> str:
    root = Path(__file__).resolve().parents[2]
    files = [file for part in _SOURCES for file in sorted((root / part).rglob("*.py"))]
    digest = hashlib.sha256(repr(conditions).encode())
    for file in files:
        if file.name not in _SHOWING:
            digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    return digest.hexdigest()[:16]
