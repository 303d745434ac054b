"""A log that was played to a service, as `replay --json` prints it."""

from __future__ import annotations

from collections import Counter

from slopewise.services.io.drive_log import DriveLog
from slopewise.services.jobs.summary import Summary
from slopewise.services.wire.parameter_messages import ParameterReply


class ReceiptRow(Summary, frozen=True):
    """Batches of samples that were answered alike."""

    status: str
    reason: str
    batches: int


class LearnedGroup(Summary, frozen=True):
    """Parameters of a group before and after the log, and their standard deviations, SI."""

    valid: bool
    cause: str
    before: dict[str, float]
    after: dict[str, float]
    stds: dict[str, float]


class VersionChange(Summary, frozen=True):
    """Versions of the parameters."""

    before: int
    after: int


class PlayedLog(Summary, frozen=True):
    """Output of `replay --json`; `driven`: seconds of the log, `took`: seconds it was played."""

    samples: int
    driven: float
    took: float
    receipts: list[ReceiptRow]
    version: VersionChange
    learned: dict[str, LearnedGroup]


def played_log(
    log: DriveLog,
    took: float,
    receipts: Counter[tuple[str, str]],
    before: ParameterReply,
    after: ParameterReply,
) -> PlayedLog:
    """Parameters before and after a log; receipts: number of batches by status and reason."""
    t = log.columns["t"]
    earlier = {group.group: group.values for group in before.groups}
    return PlayedLog(
        samples=len(t),
        driven=float(sum(t[part.stop - 1] - t[part.start] for part in log.runs)),
        took=took,
        receipts=[ReceiptRow(*answer, count) for answer, count in sorted(receipts.items())],
        version=VersionChange(before.version, after.version),
        learned={
            g.group: LearnedGroup.of(g, before=earlier.get(g.group, {}), after=g.values)
            for g in after.groups
        },
    )
