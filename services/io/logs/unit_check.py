"""Drive logs whose channels fit another unit better than their own are refused."""

from __future__ import annotations

from models.stop_logs import unit_suspects
from services.io.access import fault
from services.io.logs.drive_log import DriveLog

_NEEDED = ("v", "v_cmd", "pitch")


def refuse_wrong_units(log: DriveLog) -> None:
    """A channel that everything rests on and that fits another unit is an error, not a stretch."""
    for run, source in zip(log.runs, log.sources, strict=True):
        part = {n: v[run] for n, v in log.columns.items() if v.dtype.kind == "f"}
        for channel, reason in unit_suspects.find(part):
            if channel in _NEEDED:
                raise fault(source, f"column {channel}", reason)
