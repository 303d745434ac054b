"""Drive logs from CSV, Parquet or ROS 2 recordings: one row per sample, columns as in `units`.

`t` [s] on one clock over the whole log, `v` and `v_cmd` [m/s], angles [rad] after REP-103 (pitch
nose-down positive), `yaw_rate` [rad/s], `x`, `y` [m], `v_left`, `v_right` [m/s] at the rims,
currents [A], `brake` 0..1. Further numeric columns are retained. A file without a column `run` is
one run. Other names and units: :mod:`slopewise.services.io.columns`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.services.io.bag_log import bag_table
from slopewise.services.io.bags import is_bag
from slopewise.services.io.columns import (
    OPTION,
    ColumnName,
    parse_names,
    rename_columns,
    text_columns,
)
from slopewise.services.io.derived_speed import derived_speed, source_of_speed
from slopewise.services.io.files import fault
from slopewise.services.io.table import Table, read_table
from slopewise.services.io.topics import read_topics
from slopewise.services.io.units import OPTIONAL, REQUIRED, TEXT

_NO_COMMAND = (
    "a stop is where v_cmd goes to 0 while the vehicle rolls; coast-downs, without a command, "
    "carry no information about the brakes"
)
_OTHER_NAMES = f"other names and units: {OPTION} 't=time,v=speed:km/h'"
_MAX_ANGLE = {"pitch": math.pi / 2, "roll": math.pi}
"""Angles beyond are in degrees [rad]: no attitude is larger."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveLog:
    """Samples of one or several files; arrays are (samples,) and read-only.

    Attributes:
        columns: `run`, `terrain` and `session` as text, all others float64, NaN where not measured.
        runs: samples of each run, in the order of the files.
        one_clock: no run begins before the end of the one in front of it: `t` orders the runs.
        notes: sentences on columns that others stand for.
    """

    columns: dict[str, NDArray[Any]]
    runs: tuple[slice, ...]
    sources: tuple[str, ...]
    one_clock: bool
    notes: tuple[str, ...] = ()

    @property
    def further(self) -> tuple[str, ...]:
        """Numeric columns that have no meaning here: candidate explanations."""
        known = {*TEXT, *REQUIRED, *OPTIONAL}
        return tuple(name for name in self.columns if name not in known)


def read_logs(paths: Sequence[Path], topics: Path | None = None, names: str = "") -> DriveLog:
    """One log from tables, or from recordings.

    Without a topic mapping, topics of recordings are inferred from their types. ``names`` are those
    of columns in tables, see :mod:`slopewise.services.io.columns`.
    """
    bags = [path for path in paths if is_bag(path)]
    if not bags:
        if topics is not None:
            raise fault(topics, "", "expected recordings with a topic mapping, got tables only")
        return read_drive_log(paths, parse_names(names))
    if names:
        raise fault(OPTION, "", "expected tables, recordings have a topic mapping: --topics")
    if len(bags) < len(paths):
        table = next(path for path in paths if path not in bags)
        raise fault(table, "", "expected recordings only, got a table among them")
    channels, mapping = read_topics(topics)
    tables = [bag_table(path, channels, mapping, infer=topics is None) for path in bags]
    return _log_of_tables(tables)


def read_drive_log(paths: Sequence[Path], names: Sequence[ColumnName] = ()) -> DriveLog:
    """One log from one or several tables, in the order given.

    Columns that only some of the files have are NaN (`terrain`: empty) in the others. Each of
    several files is one session, where its column `session` does not say otherwise.
    ``names`` are those that differ from a drive log's.
    """
    if not paths:
        raise fault("drive log", "", "expected at least one file, got none")
    tables = [read_table(path, text_columns(names)) for path in paths]
    return _log_of_tables([rename_columns(table, names) if names else table for table in tables])


def _log_of_tables(tables: Sequence[Table]) -> DriveLog:
    parts = [_columns_of(table) for table in tables]
    names = list(dict.fromkeys(name for columns, _ in parts for name in columns))
    joined = {
        name: np.concatenate([columns.get(name, _missing(name, columns)) for columns, _ in parts])
        for name in names
    }
    if len(tables) > 1:
        joined["session"] = _sessions(tables)
    runs: list[slice] = []
    files: list[int] = []
    begin = 0
    for file, (columns, table_runs) in enumerate(parts):
        runs += (slice(begin + run.start, begin + run.stop) for run in table_runs)
        files += [file] * len(table_runs)
        begin += len(columns["t"])
    sources = [tables[file].source for file in files]
    _check_repeated(joined, runs, files, sources)
    t = joined["t"]
    one_clock = all(t[a.stop - 1] < t[b.start] for a, b in itertools.pairwise(runs))
    for column in joined.values():
        column.flags.writeable = False
    return DriveLog(joined, tuple(runs), tuple(sources), one_clock, _notes(tables))


def _sessions(tables: Sequence[Table]) -> NDArray[Any]:
    """Session of each row: what its file states, else the file's name."""
    stems = [Path(table.source).stem for table in tables]
    names = stems if len(set(stems)) == len(stems) else [table.source for table in tables]
    parts = []
    for table, name in zip(tables, names, strict=True):
        stated = np.full(len(table.rows), "")
        if "session" in table.columns:
            stated = np.char.strip(np.array(table.text("session")))
        parts.append(np.where(stated == "", name, stated))
    return np.concatenate(parts)


def _check_repeated(
    columns: dict[str, NDArray[Any]],
    runs: Sequence[slice],
    files: Sequence[int],
    sources: Sequence[str],
) -> None:
    """No drive is in two files, nor in one given twice: stops would count as more than there are.

    Of one file two runs may be equal: simulated ones without noise are.
    """
    seen: dict[int, int] = {}
    for i, run in enumerate(runs):
        t, v = columns["t"][run], columns["v"][run]
        first = seen.setdefault(hash((t.tobytes(), v.tobytes())), i)
        if files[first] != files[i] and np.any(v != v[0]):
            name, same = columns["run"][run.start], columns["run"][runs[first].start]
            expected = f"expected each drive once, got run {same} of {sources[first]} again"
            raise fault(sources[i], f"run {name}", expected)


def _notes(tables: Sequence[Table]) -> tuple[str, ...]:
    """Which columns stand for a speed or command that a file does not have, and its session."""
    notes: dict[str, None] = {}
    if len(tables) > 1 and any("session" not in table.columns for table in tables):
        notes["a file without a column session counts as one session"] = None
    for columns in (table.columns for table in tables):
        if "v" not in columns:
            notes[f"v is {source_of_speed(columns)}"] = None
        if "v_cmd" not in columns:
            notes["no column v_cmd: a stop begins where the brakes are applied"] = None
    return tuple(notes)


def _missing(name: str, columns: dict[str, NDArray[Any]]) -> NDArray[Any]:
    count = len(columns["t"])
    return np.full(count, "") if name in TEXT else np.full(count, np.nan)


def _columns_of(table: Table) -> tuple[dict[str, NDArray[Any]], list[slice]]:
    hints = [] if is_bag(Path(table.source)) else [_OTHER_NAMES]
    hints += [] if "v_cmd" in table.columns else [_NO_COMMAND]
    table.require(_needed(table), "; ".join(hints))
    columns: dict[str, NDArray[Any]] = {}
    if "run" not in table.columns:
        columns["run"] = np.full(len(table.rows), Path(table.source).stem)
    for name in table.columns:
        if name in TEXT:
            columns[name] = np.array(table.text(name))
        elif name in REQUIRED:
            columns[name] = table.numbers(name, REQUIRED[name])
        elif name in OPTIONAL:
            columns[name] = table.numbers(name, OPTIONAL[name], blank=np.nan)
        elif (further := _further(table, name)) is not None:
            columns[name] = further
    _check_ranges(table, columns)
    runs = _runs(table, columns)
    if "v" not in columns:
        columns["v"] = derived_speed(columns, runs)
    # Without commands, applied brakes are the stop command.
    columns.setdefault("v_cmd", np.full(len(table.rows), np.nan))
    return columns, runs


def _needed(table: Table) -> list[str]:
    """Columns that the table must have; speed and command may show in others."""
    given = {"v": bool(source_of_speed(table.columns)), "v_cmd": "brake" in table.columns}
    return [name for name in REQUIRED if not given.get(name, False)]


def _further(table: Table, name: str) -> NDArray[Any] | None:
    """A numeric column without a meaning in drive logs; None if it is text or empty."""
    values, texts = table.parsed(name)
    if texts:
        return None
    values[~np.isfinite(values)] = np.nan
    return None if np.isnan(values).all() else values


def _check_ranges(table: Table, columns: dict[str, NDArray[Any]]) -> None:
    for name, limit in _MAX_ANGLE.items():
        if name in columns and (above := np.flatnonzero(np.abs(columns[name]) > limit)).size:
            got = f"{columns[name][above[0]]:g}, which looks like degrees or per cent"
            expected = f"expected an angle within ±{limit:.3g} rad, got {got}"
            raise table.error(int(above[0]), name, expected)
    if "brake" in columns:
        brake = columns["brake"]
        if (outside := np.flatnonzero((brake < 0.0) | (brake > 1.0))).size:
            factor = "%" if np.nanmax(brake) <= 100.0 else f"1/{np.nanmax(brake):.3g}"
            hint = f"with a pressure or per cent, {OPTION} brake=brake:{factor}"
            expected = f"expected 0 … 1, got {brake[outside[0]]:g}; {hint}"
            raise table.error(int(outside[0]), "brake", expected)


def _runs(table: Table, columns: dict[str, NDArray[Any]]) -> list[slice]:
    """Runs are contiguous and time increases strictly within each."""
    run, t = columns["run"], columns["t"]
    for index in np.flatnonzero(np.char.strip(run) == ""):
        raise table.error(int(index), "run", "expected a number or name, got nothing")
    starts = [0, *(np.flatnonzero(run[1:] != run[:-1]) + 1).tolist()]
    seen: set[str] = set()
    for start in starts:
        if run[start] in seen:
            expected = f"expected the rows of a run together, got run {run[start]} a second time"
            raise table.error(start, "run", expected)
        seen.add(str(run[start]))
    backwards = np.diff(t) <= 0.0
    backwards[np.array(starts[1:], np.int64) - 1] = False
    for index in np.flatnonzero(backwards):
        # A zero is added for the sign of a negative one.
        before, got = t[index] + 0.0, t[index + 1] + 0.0
        expected = f"expected a time after {before:.9g} s, got {got:.9g}"
        raise table.error(int(index) + 1, "t", expected)
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], len(t)], strict=True)]
