"""Columns of tables with other names or units than a drive log's: `speed=v:km/h,grade=slope`.

Each entry is NAME=COLUMN[:UNIT]: meaning of a column of the file, as a drive log calls it, and the
unit that the file has it in; without one, the drive log's. A sign before the column inverts it.
A number in place of a unit is a factor, such as a wheel radius. Where the file has no such column,
but one with the first name, and the second is a drive log's, the entry is read from right to left.
"""

from __future__ import annotations

import difflib
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
_KNOWN = {**REQUIRED, **OPTIONAL, **REPLAYED, **dict.fromkeys(TEXT, "")}
_SYNONYMS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "time": ("t", 1.0),
        "speed": ("v", 1.0),
        "command": ("v_cmd", 1.0),
        "grade": ("pitch", -1.0),
    }
)
"""Names of columns in plain words, and their sign: grade is uphill positive, pitch nose down."""


@dataclass(frozen=True, slots=True)
class ColumnName:
    """One entry."""

    entry: str
    left: str
    right: str
    unit: str  # as written, or ""
    sign: float  # -1.0 if the column is inverted

    def fits(self, table: Table) -> bool:
        """Return True if left is a name of a drive log and right a column of the table."""
        return (self.left in _KNOWN or self.left in _SYNONYMS) and self.right in table.columns


def parse_names(text: str) -> tuple[ColumnName, ...]:
    """Entries of the option, separated by commas."""
    return tuple(_parse(entry.strip()) for entry in text.split(",") if text.strip())


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
    used = set()
    for name in (_oriented(n, table) for n in names):
        target, sign = _SYNONYMS.get(name.left, (name.left, 1.0))
        if target in renamed:
            raise fault(OPTION, name.entry, f"expected each column once, got {target} twice")
        used.add(name.right)
        renamed[target] = _values(table, name, target, sign)
    unchanged = {n: c for n, c in table.columns.items() if n not in used and n not in renamed}
    return replace(table, columns={**unchanged, **renamed})


def _values(table: Table, name: ColumnName, target: str, sign: float) -> list[str] | Floats:
    if target in TEXT:
        if name.unit:
            raise fault(OPTION, name.entry, f"expected no unit, {target} is text")
        return table.columns[name.right]
    unit = _KNOWN[target]
    factor = factor_to(unit, name.unit)
    if factor is None:
        expected = f"expected one of {', '.join(FACTORS[unit])}, or a factor > 0, got {name.unit}"
        raise fault(OPTION, name.entry, expected)
    blank = None if target in REQUIRED else np.nan
    values = table.numbers(name.right, name.unit or unit, blank=blank)
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
    if name.right not in table.columns:
        raise _missing(name, table)
    return name


def _missing(name: ColumnName, table: Table) -> InputError:
    header = list(table.columns)
    message = f"missing column of {OPTION} {name.entry}, got the header {','.join(header)}"
    close = difflib.get_close_matches(name.right, header, n=1)
    message += f"; is it {close[0]}?" if close else ""
    return fault(table.source, f"column {name.right}", message)
