"""Tables for a terminal, in one form for all benchmarks."""

from __future__ import annotations

from rich.table import Table


def table_of(title: str, *columns: str, first: str = "") -> Table:
    """Return a table of named rows: names to the left, figures to the right."""
    table = Table(title=title, title_justify="left")
    table.add_column(first, overflow="fold")
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table


def duration(seconds: float) -> str:
    """Format a time with a fitting unit: ``3.21 ms``."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
