"""Plans as CSV: one row a station of a candidate, SI units. What the columns mean: see the names.

`accel` holds from its station to the next, so v² is linear in between; `station` and
`clear_distance` count along the ground. Numbers keep all their digits, so that
station + stop_distance <= clear_distance survives the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.io.table import read_csv, write_csv

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


def write_plan_csv(rows: dict[str, Sequence[str] | Floats], path: Path) -> None:
    """Write a plan, all or nothing.

    Args:
        rows: the columns of :data:`COLUMNS`, all of one length; further ones are put behind.
        path: file to write.
    """
    if missing := [name for name in COLUMNS if name not in rows]:
        raise ValueError(f"a plan needs the columns {', '.join(missing)}")
    order = (*COLUMNS, *(name for name in rows if name not in COLUMNS))
    write_csv({name: rows[name] for name in order}, path)


def read_plan_csv(path: Path) -> dict[str, list[str] | Floats]:
    """The columns of a plan: texts as lists, all others as (rows,) float64.

    Raises:
        InputError: a column is missing or holds something else than numbers.
    """
    table = read_csv(path)
    table.require(COLUMNS)
    columns: dict[str, list[str] | Floats] = {}
    for name in table.columns:
        values, bad = table.parsed(name)
        if name in TEXT:
            columns[name] = table.text(name)
        elif not bad:
            columns[name] = values
        elif name in COLUMNS:
            found = table.text(name)[min(bad)]
            raise table.error(min(bad), name, f"expected a number, got {found!r}")
        else:
            columns[name] = table.text(name)
    return columns


def driven(plan: SpeedPlan) -> dict[str, Any]:
    """Columns of a plan up to its clear distance: beyond it there is nothing to drive."""
    columns = plan.columns()
    if plan.status is Status.INFEASIBLE:
        return dict(columns)
    rows = max(int(np.count_nonzero(plan.station <= plan.clear_distance)), 1)
    return {name: values[:rows] for name, values in columns.items()}


def summary(plan: SpeedPlan) -> dict[str, Any]:
    """A plan in one row, SI units; None where there is no margin to speak of."""
    return {
        "candidate": plan.candidate,
        "status": plan.status.value,
        "reason": plan.reason,
        "travel_time": plan.travel_time,
        "progress": plan.progress,
        "length": float(plan.station[-1]),
        "max_speed": float(plan.speed.max()),
        "clear_distance": plan.clear_distance,
        "least_margin": plan.least_margin if np.isfinite(plan.least_margin) else None,
        "least_rear_load": float(plan.rear_load.min()),
    }
