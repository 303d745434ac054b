"""External plan: positions and speeds of any planner, with the further columns that it reports."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, get_type_hints

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import MAX_SPEED
from slopewise.models.typed_arguments import check_fields

TEXT = ("limiting", "status", "reason")
"""Columns of text that are checked; the last two are the same in all rows."""

NEEDED = ("x", "y", "speed")
_SAME = 1e-6  # [m] rows closer than that are one place: rounding of coordinates of 1000 km

_MAX_NUMBER = 1e10
"""Size beyond that of any column in SI units, seconds since 1970 among them (1.8e9)."""

_MAX_STEP = 1e3
"""Distance between two rows beyond that of any plan [m]: far less is too sparse to judge."""

STANDSTILL_SPEED = 1e-3
"""Speed treated as zero [m/s]: from there a vehicle stops within a millimetre."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalPlan:
    """One plan of N rows, at least two where it moves.

    Arrays are (N,), SI, and None where the plan does not report them.
    """

    name: str
    x: Annotated[Floats, "m"]  # x, y: reference point of the vehicle in map coordinates
    y: Annotated[Floats, "m"]
    speed: Annotated[Floats, "m/s"]  # v >= 0; v² is linear between rows
    station: Annotated[Floats | None, "m"] = None  # along the ground, in three dimensions
    z: Annotated[Floats | None, "m"] = None  # height of the ground
    grade: Annotated[Floats | None, "rad"] = None  # grade, roll: uphill and left side up positive
    roll: Annotated[Floats | None, "rad"] = None
    curvature: Annotated[Floats | None, "1/m"] = None  # left positive
    accel: Annotated[Floats | None, "m/s²"] = None  # holds from its row to the next
    time: Annotated[Floats | None, "s"] = None  # since the start
    # emergency stop from each row, safety offset included
    stop_distance: Annotated[Floats | None, "m"] = None
    clear_distance: Annotated[Floats | None, "m"] = None  # station before which every stop ends
    # least rear axle load on the emergency stop, as a share of the level static one
    rear_load: Annotated[Floats | None, "1"] = None
    side_load: Annotated[Floats | None, "1"] = None  # the same of a side
    speed_bound: Annotated[Floats | None, "m/s"] = None  # highest speed that every bound allows
    speed_limit: Annotated[Floats | None, "m/s"] = None  # of the path
    path_deviation: Annotated[Floats | None, "m"] = None  # most of the given path around each row
    limiting: tuple[str, ...] | None = None  # (N,) names of what holds at each row
    status: str = ""  # as the planner calls it, "" if not reported
    reason: str | None = None  # sentence about the status, None if not reported
    unread: tuple[str, ...] = ()  # names of further columns, which are not verified

    def __post_init__(self) -> None:
        check_fields(self)
        count = np.size(self.x)
        if count < 1:
            raise ParameterError("plan", "at least one row, got none")
        for name, unit in COLUMNS.items():
            given = getattr(self, name)
            if given is None:
                continue
            values = np.array(given, np.float64)
            if values.shape != (count,):
                raise ParameterError(name, f"{count} numbers [{unit}], got shape {values.shape}")
            largest = MAX_SPEED if name == "speed" else _MAX_NUMBER
            if not (within := np.abs(values) <= largest).all():
                row = int(np.argmin(within))
                expected = f"a finite number within ±{largest:g} [{unit}]"
                raise ParameterError(f"{name}[{row}]", f"{expected}, got {values[row]:g}")
            object.__setattr__(self, name, values)
        steps = np.hypot(np.diff(self.x), np.diff(self.y))
        if steps.max(initial=0.0) > _MAX_STEP:
            row = int(np.argmax(steps))
            expected = f"a place within {_MAX_STEP:g} m of that of row {row}"
            raise ParameterError(f"x[{row + 1}]", f"{expected}, got one {steps[row]:.6g} m away")
        for name in ("speed", "speed_limit", "path_deviation"):
            values = getattr(self, name)
            if values is not None and values.min() < 0.0:
                row = int(np.argmax(values < 0.0))
                noun = "distance" if name == "path_deviation" else "speed"
                raise ParameterError(f"{name}[{row}]", f"a {noun} >= 0, got {values[row]:g}")
        if self.speed.max() > STANDSTILL_SPEED and not self.moved()[1:].any():
            raise ParameterError("plan", "at least 2 different places of a plan that moves, got 1")

    def moved(self) -> Bools:
        """(N,) rows that are not at the place of the row before; the first is one of them."""
        steps = np.hypot(np.diff(self.x), np.diff(self.y)) > _SAME
        return np.concatenate(([True], steps))

    def without_repeats(self) -> ExternalPlan:
        """The plan with one row for each place; of rows at one place the fastest is used."""
        moved = self.moved()
        if moved.all():
            return self
        groups = np.cumsum(moved) - 1
        changes: dict[str, Any] = {
            name: getattr(self, name)[moved] for name in COLUMNS if getattr(self, name) is not None
        }
        np.maximum.at(changes["speed"], groups, self.speed)
        if self.limiting is not None:
            changes["limiting"] = tuple(np.array(self.limiting)[moved].tolist())
        return dataclasses.replace(self, **changes)


GivenPlan = ExternalPlan  # The class under its public name

COLUMNS: dict[str, str] = {
    name: kind.__metadata__[0]
    for name, kind in get_type_hints(ExternalPlan, include_extras=True).items()
    if hasattr(kind, "__metadata__")
}
"""Columns of numbers that are checked, with their units; the first three are needed."""


def plan_of_columns(
    columns: Mapping[str, Sequence[str] | Floats], name: str = "plan"
) -> ExternalPlan:
    """One plan from columns by name, (N,) each, as plan files have them.

    ``name`` is that of the candidate where no column holds it.
    """
    for needed in NEEDED:
        if needed not in columns:
            raise ParameterError(needed, f"a column [{COLUMNS[needed]}]")
    given: dict[str, Any] = {n: np.asarray(columns[n], np.float64) for n in COLUMNS if n in columns}
    for key, column in (("name", "candidate"), ("status", "status"), ("reason", "reason")):
        if column in columns:
            cells = {str(cell) for cell in columns[column]}
            if len(cells) > 1:
                raise ParameterError(
                    column, f"the same in all rows, got {' and '.join(sorted(cells))}"
                )
            given[key] = cells.pop()
    if "limiting" in columns:
        given["limiting"] = tuple(str(cell) for cell in columns["limiting"])
    unread = tuple(n for n in columns if n not in (*COLUMNS, *TEXT, "candidate"))
    return ExternalPlan(**{"name": name, **given}, unread=unread)
