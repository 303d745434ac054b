"""Outcomes on disk, one line of JSON a set: an interrupted benchmark goes on where it was."""

from __future__ import annotations

from pathlib import Path

import msgspec

from ..common.kept import KeptLines, digest_of_sources
from .catalogue import SetConditions
from .tasks import FinishedSet, SetTask

_SOURCES = (
    "benchmarks/discovery",
    "models/discrepancy",
    "models/calibration",
    "models/effects",
    "models/laws",
    "models/stop_logs",
    "models/stops",
)
_SHOWING = ("campaign.py", "charts.py", "kept.py", "metrics.py", "multibody_runner.py", "tables.py")
"""What only counts and shows outcomes does not change them."""


def sources_of(*origins: str) -> str:
    """Name of the state of the sources that outcomes come from, and of what else they do."""
    return digest_of_sources(_SOURCES, _SHOWING, *origins)[:16]


class KeptSets:
    """Outcomes of one state of the sources under one set of conditions.

    Args:
        folder: made if it is not there. conditions: of the plant's sets.
    """

    def __init__(self, folder: Path, conditions: SetConditions) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        name = sources_of(repr(conditions))
        self._sets = KeptLines(folder / f"sets-{name}.jsonl")
        self._promises = KeptLines(folder / f"promises-{name}.txt")

    @property
    def file(self) -> Path:
        """That holds the outcomes."""
        return self._sets.file

    def find(self) -> dict[SetTask, FinishedSet]:
        """All that was done; a last line that an interruption cut off is none."""
        return {done.task: done for done in self._sets.decoded(FinishedSet)}

    def put(self, done: FinishedSet) -> None:
        """Append one."""
        self._sets.append(b"\n" + msgspec.json.encode(done))

    def promise(self, digest: str) -> None:
        """Append the digest of a truth, before anything is asked."""
        self._promises.append(digest.encode() + b"\n")
