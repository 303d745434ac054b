"""Drive logs from wherever they come: CSV, Parquet, or ROS 2 recordings with a topic mapping."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs import unit_suspects
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.access import fault
from slopewise.services.io.bags.recording import is_bag
from slopewise.services.io.logs.column_names import OPTION, parse_names
from slopewise.services.io.logs.drive_log import DriveLog, read_drive_log
from slopewise.services.io.maps.no_data import NoData

_NEEDED = ("v", "v_cmd", "pitch")
_FEW = 0.25
"""Share of the runs that may look as if they were in another unit, and are left out."""

_SHOWN = 3
"""Files that a sentence names."""


def read_logs(paths: Sequence[Path], topics: Path | None = None, names: str = "") -> DriveLog:
    """One log out of tables, or out of recordings.

    Args:
        paths: all tables, or all recordings.
        topics: topic mapping of the recordings. names: of columns in tables, see
            :mod:`slopewise.services.io.logs.column_names`.

    Raises:
        InputError: names file and field; also if tables and recordings are mixed.
    """
    bags = [path for path in paths if is_bag(path)]
    if not bags:
        if topics is not None:
            raise fault(topics, "", "expected recordings with a topic mapping, got tables only")
        return read_drive_log(paths, parse_names(names))
    if names:
        raise fault(OPTION, "", "expected tables, recordings have a topic mapping: --topics")
    if len(bags) < len(paths):
        other = next(path for path in paths if path not in bags)
        raise fault(other, "", "expected recordings only, got a table among them")
    from slopewise.services.io.logs.bag_drive_log import read_bags

    return read_bags(bags, topics)


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
    """The files in a sentence: the first few of many."""
    shown = ", ".join(str(path) for path in logs[:_SHOWN])
    return shown if len(logs) <= _SHOWN else f"{shown} … ({len(logs)} logs)"


def refuse_wrong_units(log: DriveLog) -> None:
    """A channel that everything rests on and that fits another unit is an error, not a stretch.

    One run of several that looks so, such as of a vehicle that stands while its positions wander,
    is left out with its reason, and the others are learned from.
    """
    found: dict[str, list[tuple[str, str]]] = {}
    for run, source in zip(log.runs, log.sources, strict=True):
        part = {n: v[run] for n, v in log.columns.items() if v.dtype.kind == "f"}
        for channel, reason in unit_suspects.find(part):
            if channel in _NEEDED:
                found.setdefault(channel, []).append((source, reason))
    for channel, told in found.items():
        if len(told) > _FEW * len(log.runs):
            source, reason = told[0]
            raise fault(source, f"column {channel}", reason)
