"""Plans of anybody: CSV or Parquet with x,y,speed, and any further column of a plan file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.services.check.given_plan import COLUMNS, NEEDED, GivenPlan
from slopewise.services.io.access import fault
from slopewise.services.io.parquet_table import read_parquet
from slopewise.services.io.table import Table, read_csv

_SPEEDS = ("speed", "speed_limit")


def read_given_plans(path: Path) -> list[GivenPlan]:
    """All plans of a file, in the order in which they first appear; the file's name is that of one.

    Raises:
        InputError: names the row and column that cannot be used.
    """
    table = read_parquet(path) if path.suffix.lower() == ".parquet" else read_csv(path)
    table.require(NEEDED)
    numbers = {name: _numbers(table, name) for name in COLUMNS if name in table.columns}
    status = table.text("status") if "status" in table.columns else None
    plans = []
    for name, rows in _rows_of(table, path).items():
        own = {column: values[rows] for column, values in numbers.items()}
        own = {column: values for column, values in own.items() if not np.isnan(values).all()}
        for column, values in own.items():
            if np.isnan(values).any():
                words = f"expected a number [{COLUMNS[column]}] in every row of {name} or in none"
                row = rows[int(np.argmax(np.isnan(values)))]
                raise table.error(row, column, f"{words}, got nothing")
        said = "" if status is None else status[rows[0]]
        try:
            plans.append(GivenPlan(name=name, status=said, **own))
        except ParameterError as error:
            field = f"candidate {name}, {error.field}"
            raise fault(path, field, f"expected {error.expected}") from None
    return plans


def _numbers(table: Table, name: str) -> Floats:
    """A column, NaN where an optional one is left empty."""
    unit = COLUMNS[name]
    values = table.numbers(name, unit, blank=None if name in NEEDED else np.nan)
    for index in np.flatnonzero(values < 0.0) if name in _SPEEDS else ():
        words = f"expected a speed >= 0 [{unit}], got {values[index]:g}"
        raise table.error(int(index), name, words)
    return values


def _rows_of(table: Table, path: Path) -> dict[str, list[int]]:
    if "candidate" not in table.columns:
        return {path.stem: list(range(len(table.rows)))}
    plans: dict[str, list[int]] = {}
    for index, name in enumerate(table.text("candidate")):
        if not name.strip():
            raise table.error(index, "candidate", "expected a name, got nothing")
        plans.setdefault(name, []).append(index)
    return plans
