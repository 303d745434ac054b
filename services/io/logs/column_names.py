"""Columns of tables that have other names or units than a drive log's: `speed=v:km/h,grade=slope`.

Each entry is NAME=COLUMN[:UNIT]: what a column of the file means, as a drive log calls it, and the
unit that the file has it in; without one, the drive log's. A sign before the column turns it round.
A number in place of a unit is a factor, such as a wheel radius. Where the file has no such column,
but one with the first name, and the second is a drive log's, the entry is read the other way round.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.io.access import fault
from slopewise.services.io.table import Table

OPTION = "--columns"
_TEXT = ("run", "terrain")
_FACTORS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
        "m/s": {
            "m/s": 1.0,
            "km/h": 1.0 / 3.6,
            "mph": 0.44704,
            "knots": 0.514444,
            "kn": 0.514444,
            "cm/s": 1e-2,
            "mm/s": 1e-3,
            "ft/s": 0.3048,
        },
        "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0, "%": 0.01},
        "rad/s": {
            "rad/s": 1.0,
            "deg/s": math.pi / 180.0,
            "°/s": math.pi / 180.0,
            "rpm": math.pi / 30,
        },
        "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048},
        "1/m": {"1/m": 1.0},
        "A": {"A": 1.0, "mA": 1e-3},
        "1": {"1": 1.0, "%": 0.01},
    }
)
_OTHER_NAMES: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "time": ("t", 1.0),
        "speed": ("v", 1.0),
        "command": ("v_cmd", 1.0),
        "grade": ("pitch", -1.0),
    }
)
"""Words for columns, and their sign: grade is uphill positive, pitch nose down."""


@dataclass(frozen=True, slots=True)
class Naming:
    """One entry.

    Attributes:
        entry: as it was written. left, right: around the equals sign. unit: as written, or "".
        sign: -1.0 if the column is turned round.
    """

    entry: str
    left: str
    right: str
    unit: str
    sign: float


def parse_names(text: str) -> tuple[Naming, ...]:
    """Entries of the option, separated by commas.

    Raises:
        InputError: names the entry that cannot be read.
    """
    return tuple(_naming(entry.strip()) for entry in text.split(",") if text.strip())


def _naming(entry: str) -> Naming:
    left, equals, rest = (part.strip() for part in entry.partition("="))
    right, _, unit = (part.strip() for part in rest.partition(":"))
    if not (left and equals and right):
        words = "expected NAME=COLUMN or NAME=COLUMN:UNIT, such as speed=v:km/h"
        raise fault(OPTION, entry, words)
    sign = -1.0 if right.startswith("-") else 1.0
    return Naming(entry, left, right.removeprefix("-").strip(), unit, sign)


def text_columns(names: Iterable[Naming]) -> tuple[str, ...]:
    """Columns of files that are text even where they look like numbers."""
    pairs = ((n.left, n.right) for n in names)
    return tuple(b for pair in pairs for a, b in (pair, pair[::-1]) if a in _TEXT)


def renamed(
    table: Table, names: Sequence[Naming], units: Mapping[str, str], required: Iterable[str]
) -> Table:
    """The table as a drive log names it, in the drive log's units.

    Args:
        table: of a file. names: entries. units: of every column that has a meaning in a drive log.
        required: columns whose cells may not be empty.

    Raises:
        InputError: an entry has an unknown name or unit, or its column is not in the file; a cell
            is no number, in the file's own name of the column.
    """
    known = {**units, **dict.fromkeys(_TEXT, "")}
    made: dict[str, list[str] | Floats] = {}
    used = set()
    for naming in (_the_right_way_round(n, table, known) for n in names):
        target, sign = _OTHER_NAMES.get(naming.left, (naming.left, 1.0))
        if target in made:
            raise fault(OPTION, naming.entry, f"expected each column once, got {target} twice")
        used.add(naming.right)
        if target in _TEXT:
            if naming.unit:
                raise fault(OPTION, naming.entry, f"expected no unit, {target} is text")
            made[target] = table.columns[naming.right]
            continue
        factor = _factor(naming, known[target])
        blank = None if target in required else np.nan
        values = table.numbers(naming.right, naming.unit or known[target], blank=blank)
        values = naming.sign * sign * factor * values
        made[target] = np.arctan(values) if _is_slope(naming, known[target]) else values
    kept = {n: c for n, c in table.columns.items() if n not in used and n not in made}
    return replace(table, columns={**kept, **made})


def _the_right_way_round(naming: Naming, table: Table, known: Mapping[str, str]) -> Naming:
    """The entry with the drive log's name on the left."""
    turned = replace(naming, left=naming.right, right=naming.left)
    fits, fits_turned = (_fits(n, table, known) for n in (naming, turned))
    if fits and fits_turned and naming.left in _OTHER_NAMES and naming.right in known:
        one, other = naming.right, naming.left
        words = (
            f"expected one meaning, got a file with columns {one} and {other}: "
            f"write {one}={other} or {one}={one}"
        )
        raise fault(OPTION, naming.entry, words)
    if fits or not fits_turned:
        _check(naming, table, known)
        return naming
    return turned


def _fits(naming: Naming, table: Table, known: Mapping[str, str]) -> bool:
    return (naming.left in known or naming.left in _OTHER_NAMES) and naming.right in table.columns


def _check(naming: Naming, table: Table, known: Mapping[str, str]) -> None:
    if naming.left not in known and naming.left not in _OTHER_NAMES:
        words = f"expected one of {', '.join((*known, *_OTHER_NAMES))}, got {naming.left}"
        raise fault(OPTION, naming.entry, words)
    if naming.right not in table.columns:
        raise _not_there(naming, table)


def _not_there(naming: Naming, table: Table) -> InputError:
    header = list(table.columns)
    words = f"missing column of {OPTION} {naming.entry}, got the header {','.join(header)}"
    close = difflib.get_close_matches(naming.right, header, n=1)
    words += f"; is it {close[0]}?" if close else ""
    return fault(table.source, f"column {naming.right}", words)


def _factor(naming: Naming, unit: str) -> float:
    """From the unit of an entry to the drive log's."""
    if not naming.unit:
        return 1.0
    factors = _FACTORS[unit]
    if naming.unit in factors:
        return factors[naming.unit]
    try:
        factor = float(naming.unit)
    except ValueError:
        factor = math.nan
    if not (math.isfinite(factor) and factor > 0.0):
        words = f"expected one of {', '.join(factors)}, or a factor > 0, got {naming.unit}"
        raise fault(OPTION, naming.entry, words)
    return factor


def _is_slope(naming: Naming, unit: str) -> bool:
    """Per cent of an angle are its tangent."""
    return unit == "rad" and naming.unit == "%"
