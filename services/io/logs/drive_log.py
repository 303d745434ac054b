"""Drive logs: CSV or Parquet, one row a sample, columns run,t,v,v_cmd,pitch and more.

`t` [s] on one clock over the whole log, `v` and `v_cmd` [m/s], angles [rad] after REP-103 (pitch
nose-down positive), `yaw_rate` [rad/s], `x`, `y` [m], `v_left`, `v_right` [m/s] at the rims,
currents [A], `brake` 0..1. Further numeric columns are kept. Without a column `run` a file is one.
Other names and units: :mod:`slopewise.services.io.logs.column_names`.
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

from slopewise.services.io.access import fault
from slopewise.services.io.logs.column_names import Naming, renamed, text_columns
from slopewise.services.io.parquet_table import read_parquet
from slopewise.services.io.table import Table, read_csv

REQUIRED = {"t": "s", "v": "m/s", "v_cmd": "m/s", "pitch": "rad"}
OPTIONAL = {
    "roll": "rad",
    "yaw": "rad",
    "yaw_rate": "rad/s",
    "x": "m",
    "y": "m",
    "v_left": "m/s",
    "v_right": "m/s",
    "current_left": "A",
    "current_right": "A",
    "brake": "1",
}
_TEXT = ("run", "terrain")
_FURTHER = {"vertical_curvature": "1/m"}  # what replays read beside
_A_STOP = (
    "a stop is where v_cmd goes to 0 while the vehicle rolls; coast-downs, without a command, say "
    "nothing of the brakes"
)
_LARGEST = {"pitch": math.pi / 2, "roll": math.pi}


@dataclass(frozen=True, slots=True)
class DriveLog:
    """Samples of one or several files; arrays are (samples,) and read-only.

    Attributes:
        columns: `run` and `terrain` as text, all others float64, NaN where not measured.
        runs: samples of each run, in the order of the files.
        sources: file of each run.
        one_clock: no run begins before the one in front of it ends: `t` tells how long ago it was.
    """

    columns: dict[str, NDArray[Any]]
    runs: tuple[slice, ...]
    sources: tuple[str, ...]
    one_clock: bool

    @property
    def further(self) -> tuple[str, ...]:
        """Numeric columns that have no meaning here: candidate explanations."""
        known = {*_TEXT, *REQUIRED, *OPTIONAL}
        return tuple(name for name in self.columns if name not in known)


def read_drive_log(paths: Sequence[Path], names: Sequence[Naming] = ()) -> DriveLog:
    """One log out of one or several files, in the order given.

    Columns that only some of the files have are NaN (`terrain`: empty) in the others.

    Args:
        paths: the files. names: of columns that the files call otherwise.

    Raises:
        InputError: names the row and column. Parquet rows count from 1.
    """
    if not paths:
        raise fault("drive log", "", "expected at least one file, got none")
    return log_of_tables([_read_table(path, names) for path in paths])


def log_of_tables(tables: Sequence[Table]) -> DriveLog:
    """One log out of tables that were read already; see :func:`read_drive_log`."""
    parts = [_columns_of(table) for table in tables]
    names = list(dict.fromkeys(name for columns, _ in parts for name in columns))
    joined = {
        name: np.concatenate([columns.get(name, _nothing(name, columns)) for columns, _ in parts])
        for name in names
    }
    runs: list[slice] = []
    sources: list[str] = []
    begin = 0
    for table, (columns, own) in zip(tables, parts, strict=True):
        runs += (slice(begin + run.start, begin + run.stop) for run in own)
        sources += [table.source] * len(own)
        begin += len(columns["t"])
    t = joined["t"]
    one_clock = all(t[a.stop - 1] < t[b.start] for a, b in itertools.pairwise(runs))
    for column in joined.values():
        column.flags.writeable = False
    return DriveLog(joined, tuple(runs), tuple(sources), one_clock)


def _nothing(name: str, columns: dict[str, NDArray[Any]]) -> NDArray[Any]:
    count = len(columns["t"])
    return np.full(count, "") if name in _TEXT else np.full(count, np.nan)


def _read_table(path: Path, names: Sequence[Naming]) -> Table:
    parquet = path.suffix.lower() in (".parquet", ".pq")
    table = read_parquet(path) if parquet else read_csv(path, (*_TEXT, *text_columns(names)))
    if not names:
        return table
    return renamed(table, names, {**REQUIRED, **OPTIONAL, **_FURTHER}, REQUIRED)


def _columns_of(table: Table) -> tuple[dict[str, NDArray[Any]], list[slice]]:
    table.require(REQUIRED, "" if "v_cmd" in table.columns else _A_STOP)
    columns: dict[str, NDArray[Any]] = {}
    if "run" not in table.columns:
        columns["run"] = np.full(len(table.rows), Path(table.source).stem)
    for name in table.columns:
        if name in _TEXT:
            columns[name] = np.array(table.text(name))
        elif name in REQUIRED:
            columns[name] = table.numbers(name, REQUIRED[name])
        elif name in OPTIONAL:
            columns[name] = table.numbers(name, OPTIONAL[name], blank=np.nan)
        elif (further := _further(table, name)) is not None:
            columns[name] = further
    _check_ranges(table, columns)
    return columns, _runs(table, columns)


def _further(table: Table, name: str) -> NDArray[Any] | None:
    """A numeric column that nobody asked for; None if it is text or holds nothing."""
    values, bad = table.parsed(name)
    if any(str(table.columns[name][index]).strip() for index in bad):
        return None
    values[~np.isfinite(values)] = np.nan
    return None if np.isnan(values).all() else values


def _check_ranges(table: Table, columns: dict[str, NDArray[Any]]) -> None:
    for name, largest in _LARGEST.items():
        if name in columns and (bad := np.flatnonzero(np.abs(columns[name]) > largest)).size:
            found = f"{columns[name][bad[0]]:g}, which looks like degrees"
            words = f"expected an angle within ±{largest:.3g} rad, got {found}"
            raise table.error(int(bad[0]), name, words)
    if "brake" in columns:
        brake = columns["brake"]
        if (bad := np.flatnonzero((brake < 0.0) | (brake > 1.0))).size:
            words = f"expected 0 … 1, got {brake[bad[0]]:g}"
            raise table.error(int(bad[0]), "brake", words)


def _runs(table: Table, columns: dict[str, NDArray[Any]]) -> list[slice]:
    """Runs are contiguous and time increases strictly within each."""
    run, t = columns["run"], columns["t"]
    for index in np.flatnonzero(np.char.strip(run) == ""):
        raise table.error(int(index), "run", "expected a number or name, got nothing")
    starts = [0, *(np.flatnonzero(run[1:] != run[:-1]) + 1).tolist()]
    seen: set[str] = set()
    for start in starts:
        if run[start] in seen:
            words = f"expected the rows of a run together, got run {run[start]} a second time"
            raise table.error(start, "run", words)
        seen.add(str(run[start]))
    backwards = np.diff(t) <= 0.0
    backwards[np.array(starts[1:], np.int64) - 1] = False
    for index in np.flatnonzero(backwards):
        words = f"expected a time after {t[index]:.9g} s, got {t[index + 1]:.9g}"
        raise table.error(int(index) + 1, "t", words)
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], len(t)], strict=True)]
