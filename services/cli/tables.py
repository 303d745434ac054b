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
) -> Iterator[Table | Text]:
    """A table; the first column, and those of `left`, are aligned to the left.

    None is shown as a dash, Text keeps its style. With `more`, "more plans; --json gives all", only
    the first rows are listed, and a line ends with it.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(title=title or None, box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for index, column in enumerate(columns):
        grid.add_column(
            Text(column),
            justify="left" if not index or column in left else "right",
            overflow="fold",
        )
    all_rows = list(rows)
    for row in all_rows[:LISTED] if more else all_rows:
        cells = ("–" if cell is None else cell for cell in row)
        grid.add_row(*(cell if isinstance(cell, Text) else Text(str(cell)) for cell in cells))
    yield grid
    if more and len(all_rows) > LISTED:
        yield Text(f"… and {len(all_rows) - LISTED} {more}")


def line(text: str, style: str = "") -> Text:
    """A line without markup."""
    from rich.text import Text

    return Text(text, style=style)


def notes(texts: Iterable[str], label: str = "note") -> Iterator[Text]:
    """A yellow line per text."""
    return (line(f"{label}: {text}", "yellow") for text in texts)


def rejections(reasons: Iterable[str], name: str = "", *, written: bool = True) -> Iterator[Text]:
    """Red lines of a calibration's objections; of a vehicle's name, with or without model file."""
    for reason in reasons:
        yield line(f"{name} rejected: {reason}".lstrip(), "red")
    if written:
        warning = "do not plan with this model: real stops may be far longer than planned"
        yield line(f"{name}: {warning}" if name else warning, "red")


def number(value: float | None, form: str) -> str | None:
    """A number in a format such as ".3f"; None for none."""
    return None if value is None else format(value, form)
