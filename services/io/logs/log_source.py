"""Checks of a drive log before anything is learned from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs import unit_suspects
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault
from slopewise.services.io.no_data import NoData

_NEEDED = ("v", "v_cmd", "pitch")
_FEW = 0.25
"""Share of the runs that may look as if they were in another unit, and are excluded."""

_SHOWN = 3  # Files that a sentence names


def grade_by_map(
    log: DriveLog, map_file: Path | None, vehicle: Vehicle, nodata: NoData = None
) -> Floats | None:
    """As :func:`slopewise.services.io.logs.track_grade.ground_grade`; None where there is no
    map.
    """
    if map_file is None:
        return None
    from slopewise.services.io.logs.track_grade import ground_grade

    return ground_grade(log, map_file, vehicle, nodata)


def names_of(logs: Sequence[Path]) -> str:
    """The files as text: the first few of many."""
    shown = ", ".join(str(path) for path in logs[:_SHOWN])
    return shown if len(logs) <= _SHOWN else f"{shown} … ({len(logs)} logs)"


def refuse_wrong_units(log: DriveLog) -> None:
    """A channel that everything rests on and that fits another unit is an error, not a stretch.

    One run of several that looks so, such as of a vehicle that stands while its positions wander,
    is excluded with its reason, and the others are used.
    """
    suspects: dict[str, list[tuple[str, str]]] = {}
    for run, source in zip(log.runs, log.sources, strict=True):
        part = {n: v[run] for n, v in log.columns.items() if v.dtype.kind == "f"}
        for channel, reason in unit_suspects.find(part):
            if channel in _NEEDED:
                suspects.setdefault(channel, []).append((source, reason))
    for channel, reasons in suspects.items():
        if len(reasons) > _FEW * len(log.runs):
            source, reason = reasons[0]
            raise fault(source, f"column {channel}", reason)
