"""Tables for a terminal, in one form for all benchmarks."""

from __future__ import annotations

import operator
from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

from rich.console import Console
from rich.markup import escape
from rich.table import Table

Row = TypeVar("Row")
Key = TypeVar("Key", bound=Hashable)
RELATIONS = {"<=": operator.le, ">=": operator.ge}  # of values to targets


def grouped(rows: Sequence[Row], key: Callable[[Row], Key]) -> dict[Key, list[Row]]:
    """Rows by their key, in the order of first rows."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def table_of(title: str, *columns: str, first: str = "") -> Table:
    """Return a table of named rows: names to the left, figures to the right."""
    table = Table(title=title, title_justify="left")
    table.add_column(escape(first), overflow="fold")
    for column in columns:
        table.add_column(escape(column), justify="right", overflow="fold")
    return table


def print_rows(
    console: Console, title: str, rows: Sequence[dict[str, Any]], *names: str, first: str = ""
) -> None:
    """Print rows of the same keys; those of ``names`` stand together in the first column."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    names = names or (columns[0],)
    figures = [key for key in columns if key not in names]
    table = table_of(title, *figures, first=first or ", ".join(names))
    for row in rows:
        label = " ".join(str(row[key]) for key in names)
        table.add_row(label, *(str(row.get(key, "")) for key in figures))
    console.print(table)


def duration(seconds: float) -> str:
    """Format a time with a fitting unit: ``3.21 ms``."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
