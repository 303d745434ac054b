"""Tables and lines that commands print."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

LISTED = 30
"""Rows of a table, and lines of a list, that fit on a few screens; --json has all."""


def table(
    columns: Iterable[str],
    rows: Iterable[Iterable[object]],
    *,
    title: str = "",
    left: Collection[str] = (),
    more: str = "",
    limit: int = LISTED,
) -> Iterator[Table | Text]:
    """A table of the first rows, and a line on the others.

    Args:
        columns: titles.
        rows: cells; None is shown as a dash, Text keeps its style.
        title: title of the table.
        left: columns that are aligned to the left, besides the first.
        more: end of the line on rows that are not listed, "more plans; --json gives all".
        limit: number of rows that are listed.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(title=title or None, box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for index, column in enumerate(columns):
        grid.add_column(
            Text(column),
            justify="left" if not index or column in left else "right",
            no_wrap=column not in left,
            overflow="fold",
        )
    all_rows = list(rows)
    for row in all_rows[:limit]:
        grid.add_row(*(cell if isinstance(cell, Text) else Text(_shown(cell)) for cell in row))
    yield grid
    if more and len(all_rows) > limit:
        yield Text(f"… and {len(all_rows) - limit} {more}")


def _shown(cell: object) -> str:
    return "–" if cell is None else str(cell)


def line(text: str, style: str = "") -> Text:
    """A line without markup."""
    from rich.text import Text

    return Text(text, style=style)


def notes(texts: Iterable[str], label: str = "note") -> Iterator[Text]:
    """A yellow line per text."""
    for text in texts:
        yield line(f"{label}: {text}", "yellow")


def named(name: str, text: str) -> Text:
    """An indented line that begins with a name in bold."""
    from rich.text import Text

    return Text.assemble("  ", (name, "bold"), f": {text}")


def decimals(value: float | None, digits: int, unit: str = "") -> str | None:
    """A number with a fixed number of decimals, None for none."""
    return None if value is None else f"{value:.{digits}f}{unit}"
