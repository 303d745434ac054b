"""Speed plans as tables, SI units: ours with all columns, those of other planners with x,y,speed.

One row per station of a candidate; names say what columns hold. `accel` holds from its station to
the next, so v² is linear in between; `station` and `clear_distance` count along the ground. Numbers
keep all their digits, so that station + stop_distance <= clear_distance survives the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.check.external_plan import COLUMNS as CHECKED
from slopewise.services.check.external_plan import NEEDED, ExternalPlan, plan_of_columns
from slopewise.services.io.files import faults_of
from slopewise.services.io.table import Table, read_table, write_csv
from slopewise.services.io.units import finite

_ROUNDING = 1e-9
"""Of stations: a row at the clear distance belongs to the plan [m]."""

TEXT = ("candidate", "limiting", "status", "reason")
COLUMNS = (
    "candidate",
    "station",
    "x",
    "y",
    "z",
    "grade",
    "roll",
    "curvature",
    "speed",
    "accel",
    "time",
    "speed_bound",
    "limiting",
    "stop_distance",
    "clear_distance",
    "rear_load",
    "status",
    "reason",
)
"""Columns in their order: m, m/s, m/s², s, rad, 1/m; `rear_load` is a share of the static load."""

_SPEEDS = ("speed", "speed_limit")


def write_plan_csv(rows: dict[str, Sequence[str] | Floats], path: Path) -> None:
    """Write the columns of :data:`COLUMNS`, and further ones behind them, all or nothing."""
    if missing := [name for name in COLUMNS if name not in rows]:
        raise ValueError(f"a plan needs the columns {', '.join(missing)}")
    order = (*COLUMNS, *(name for name in rows if name not in COLUMNS))
    write_csv({name: rows[name] for name in order}, path)


def read_external_plans(path: Path) -> list[ExternalPlan]:
    """All plans of a CSV or Parquet file, in the order in which they first appear.

    Without a column `candidate` it is one plan with the file's name.
    """
    table = read_table(path)
    table.require(NEEDED)
    numbers = {name: _numbers(table, name) for name in CHECKED if name in table.columns}
    texts = {name: table.text(name) for name in table.columns if name not in numbers}
    plans = []
    for name, rows in table.rows_by_candidate().items():
        given = {
            column: table.all_or_none(column, values, rows, name, CHECKED[column])
            for column, values in numbers.items()
        }
        columns: Any = {column: v for column, v in given.items() if v is not None}
        columns |= {column: [cells[i] for i in rows] for column, cells in texts.items()}
        with faults_of(path, f"candidate {name}, "):
            plans.append(plan_of_columns(columns, name))
    return plans


def _numbers(table: Table, name: str) -> Floats:
    """A column, NaN where an optional one is left empty."""
    unit = CHECKED[name]
    values = table.numbers(name, unit, blank=None if name in NEEDED else np.nan)
    for index in np.flatnonzero(values < 0.0) if name in _SPEEDS else ():
        expected = f"expected a speed >= 0 [{unit}], got {values[index]:g}"
        raise table.error(int(index), name, expected)
    return values


def driven(plan: SpeedPlan) -> dict[str, Any]:
    """Columns of a plan up to its clear distance: nothing beyond it is driven.

    Full braking moves a row back to where it ends: a fallback has the row behind it as well.
    """
    columns = plan.columns()
    if plan.status is Status.INFEASIBLE:
        return dict(columns)
    rows = max(int(np.count_nonzero(plan.station <= plan.clear_distance + _ROUNDING)), 1)
    if plan.status is Status.DEGRADED:
        rows += 1
    return {name: values[:rows] for name, values in columns.items()}


def joined(plans: Sequence[SpeedPlan]) -> dict[str, Any]:
    """Columns of :func:`driven` of several plans, one below the other; none without a plan."""
    parts = [driven(plan) for plan in plans]
    return {
        name: [cell for part in parts for cell in part[name]]
        if name in TEXT
        else np.concatenate([part[name] for part in parts])
        for name in (parts[0] if parts else ())
    }


def summary(plan: SpeedPlan) -> dict[str, Any]:
    """A plan in one row, SI units; None where it has no stop margin."""
    return {
        "candidate": plan.candidate,
        "status": plan.status.value,
        "reason": plan.reason,
        "travel_time": plan.travel_time,
        "progress": plan.progress,
        "length": float(plan.station[-1]),
        "max_speed": float(plan.speed.max()),
        "clear_distance": plan.clear_distance,
        "least_margin": finite(plan.least_margin),
        "least_rear_load": float(plan.rear_load.min()),
    }
