"""Columns of tables with other names or units than a drive log's: `speed=v:km/h,grade=slope`.

Each entry is NAME=COLUMN[:UNIT]: meaning of a column of the file, as a drive log calls it, and the
unit that the file has it in; without one, the drive log's. A sign before the column inverts it.
A number or quotient in place of a unit is a factor, such as a wheel radius, or 1/80 for pressures
of 80 bar at full brakes. In place of a column, a number is a constant (`pitch=0`), and `mean(a,b)`
the mean of several. Where the file has no such column, but one with the first name, and the second
is a drive log's, the entry is read from right to left.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.io.files import fault
from slopewise.services.io.table import Table
from slopewise.services.io.units import FACTORS, OPTIONAL, REPLAYED, REQUIRED, TEXT, factor_to

OPTION = "--columns"
_MEAN = re.compile(r"mean\((.+)\)")
_COMMA = re.compile(r",(?![^(]*\))")
_KNOWN = {**REQUIRED, **OPTIONAL, **REPLAYED, **dict.fromkeys(TEXT, "")}
_SYNONYMS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {"time": ("t", 1.0), "speed": ("v", 1.0), "command": ("v_cmd", 1.0), "grade": ("pitch", -1.0)}
)
"""Names of columns in plain words, and their sign: grade is uphill positive, pitch nose down."""


@dataclass(frozen=True, slots=True)
class ColumnName:
    """One entry."""

    entry: str
    left: str
    right: str  # a column, a number, or mean(…)
    unit: str  # as written, or ""
    sign: float  # -1.0 if the column is inverted

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the file, several where their mean is taken."""
        mean = _MEAN.fullmatch(self.right)
        return (self.right,) if mean is None else tuple(c.strip() for c in mean[1].split(","))

    def constant(self, table: Table) -> float | None:
        """The number in place of a column, None if it is not a number."""
        try:
            return None if self.right in table.columns else float(self.right)
        except ValueError:
            return None

    def fits(self, table: Table) -> bool:
        """Return True if left is a name of a drive log and right a column of the table."""
        is_there = all(c in table.columns for c in self.columns)
        is_known = self.left in _KNOWN or self.left in _SYNONYMS
        return is_known and (is_there or self.constant(table) is not None)


def parse_names(text: str) -> tuple[ColumnName, ...]:
    """Entries of the option, separated by commas."""
    return tuple(_parse(entry.strip()) for entry in _COMMA.split(text) if text.strip())


def _parse(entry: str) -> ColumnName:
    left, equals, rest = (part.strip() for part in entry.partition("="))
    right, _, unit = (part.strip() for part in rest.partition(":"))
    if not (left and equals and right):
        expected = "expected NAME=COLUMN or NAME=COLUMN:UNIT, such as speed=v:km/h"
        raise fault(OPTION, entry, expected)
    sign = -1.0 if right.startswith("-") else 1.0
    return ColumnName(entry, left, right.removeprefix("-").strip(), unit, sign)


def text_columns(names: Iterable[ColumnName]) -> tuple[str, ...]:
    """Columns of files that are text even where they look like numbers."""
    pairs = ((n.left, n.right) for n in names)
    return (*TEXT, *(b for pair in pairs for a, b in (pair, pair[::-1]) if a in TEXT))


def rename_columns(table: Table, names: Sequence[ColumnName]) -> Table:
    """The table with a drive log's names and units."""
    renamed: dict[str, list[str] | Floats] = {}
    used: set[str] = set()
    for name in (_oriented(n, table) for n in names):
        target, sign = _SYNONYMS.get(name.left, (name.left, 1.0))
        if target in renamed:
            raise fault(OPTION, name.entry, f"expected each column once, got {target} twice")
        used.update(name.columns)
        renamed[target] = _values(table, name, target, sign)
    unchanged = {n: c for n, c in table.columns.items() if n not in used and n not in renamed}
    return replace(table, columns={**unchanged, **renamed})


def _values(table: Table, name: ColumnName, target: str, sign: float) -> list[str] | Floats:
    if target in TEXT:
        if name.unit:
            raise fault(OPTION, name.entry, f"expected no unit, {target} is text")
        return table.columns.get(name.right, len(table.rows) * [name.right])
    unit = _KNOWN[target]
    factor = factor_to(unit, name.unit)
    if factor is None:
        expected = f"expected one of {', '.join(FACTORS[unit])}, or a factor > 0, got {name.unit}"
        raise fault(OPTION, name.entry, expected)
    blank = None if target in REQUIRED else np.nan
    if (constant := name.constant(table)) is not None:
        values = np.full(len(table.rows), constant)
    else:
        several = [table.numbers(c, name.unit or unit, blank=blank) for c in name.columns]
        values = several[0] if len(several) == 1 else np.mean(several, axis=0)
    values = name.sign * sign * factor * values
    # Per cent of an angle are its tangent.
    return np.arctan(values) if unit == "rad" and name.unit == "%" else values


def _oriented(name: ColumnName, table: Table) -> ColumnName:
    """The entry with the drive log's name on the left."""
    swapped = replace(name, left=name.right, right=name.left)
    fits, fits_swapped = name.fits(table), swapped.fits(table)
    if fits and fits_swapped and name.left in _SYNONYMS and name.right in _KNOWN:
        a, b = name.right, name.left
        expected = (
            f"expected one meaning, got a file with columns {a} and {b}: write {a}={b} or {a}={a}"
        )
        raise fault(OPTION, name.entry, expected)
    if fits_swapped and not fits:
        return swapped
    if name.left not in _KNOWN and name.left not in _SYNONYMS:
        expected = f"expected one of {', '.join((*_KNOWN, *_SYNONYMS))}, got {name.left}"
        raise fault(OPTION, name.entry, expected)
    absent = [c for c in name.columns if c not in table.columns]
    if absent and name.constant(table) is None and name.left not in TEXT:
        raise _missing(name, absent[0], table)
    return name


def _missing(name: ColumnName, column: str, table: Table) -> InputError:
    header = list(table.columns)
    message = f"missing column of {OPTION} {name.entry}, got the header {','.join(header)}"
    close = difflib.get_close_matches(column, header, n=1)
    message += f"; is it {close[0]}?" if close else ""
    return fault(table.source, f"column {column}", message)


def in_own_units(sentence: str, names: Sequence[ColumnName]) -> str:
    """The sentence with its numbers in the units that a file has, such as km/h for m/s."""
    for name in names:
        target = _SYNONYMS.get(name.left, (name.left, 1.0))[0]
        unit = _KNOWN.get(target, "")
        factor = FACTORS.get(unit, {}).get(name.unit)
        if factor is not None and name.unit != unit:
            sentence = _converted(sentence, unit, name.unit, factor)
    return sentence


def _converted(sentence: str, unit: str, file_unit: str, factor: float) -> str:
    number = re.compile(rf"(-?\d+(?:\.\d+)?) {re.escape(unit)}(?![\w/²])")
    return number.sub(lambda m: f"{float(m[1]) / factor:.6g} {file_unit}", sentence)
