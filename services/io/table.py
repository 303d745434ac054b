"""Tables with a header: CSV in and out, numbers checked cell by cell with the row they stand in."""

from __future__ import annotations

import contextlib
import csv
import difflib
import gc
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.io.access import fault, read_text, shown, write_atomic
from slopewise.services.io.plain_csv import plain_columns

_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_LONG = 1_000_000  # characters from which loading another reader pays


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of a file by name, in the file's order.

    Attributes:
        source: file as the user named it.
        columns: name -> cells as text, or numbers where the format has them.
        rows: number of each row in the file; a CSV's header is row 1.
    """

    source: str
    columns: dict[str, list[str] | Floats]
    rows: Sequence[int]

    def error(self, index: int, column: str, expected: str) -> InputError:
        """An InputError at a cell; ``index`` counts the rows from 0."""
        return fault(self.source, f"row {self.rows[index]}, column {column}", expected)

    def require(self, columns: Iterable[str], why: str = "") -> None:
        """Raise InputError unless all these columns are there, and at least one row.

        Args:
            columns: their names. why: they are needed, for the error message.
        """
        missing = [name for name in columns if name not in self.columns]
        if missing:
            field = ", ".join(f"column {name}" for name in missing)
            words = self._missing(missing)
            raise fault(self.source, field, f"{words}; {why}" if why else words)
        if not len(self.rows):
            raise fault(self.source, "row 2", "expected at least one row, got the header only")

    def _missing(self, names: Sequence[str]) -> str:
        header = list(self.columns)
        several = len(names) > 1
        found = f"missing column{'s' if several else ''}, got the header {','.join(header)}"
        if len(header) == 1 and any(mark in header[0] for mark in ";\t "):
            return f"{found}; expected commas between columns"
        if all(_is_number(column) for column in header):
            return f"{found}; expected names in the first row"
        lower = {column.lower(): column for column in header}
        for name in names:
            if close := difflib.get_close_matches(name, lower, n=1):
                found += f"; is {name if several else 'it'} {lower[close[0]]}?"
        return found

    def text(self, column: str) -> list[str]:
        """Cells as text; whole numbers without a decimal point."""
        cells = self.columns[column]
        if isinstance(cells, list):
            return [plain(cell) for cell in cells]
        return ["" if math.isnan(c) else repr(c).removesuffix(".0") for c in cells.tolist()]

    def numbers(self, column: str, unit: str, *, blank: float | None = None) -> Floats:
        """(rows,) finite numbers.

        Args:
            column: its name.
            unit: for the error message.
            blank: stands for an empty cell or NaN; None refuses them.

        Raises:
            InputError: names the row of the first cell that is none.
        """
        values, bad = self.parsed(column)
        wrong = ~np.isfinite(values) if blank is None else np.isinf(values)
        wrong[list(bad)] = True
        if wrong.any():
            index = int(np.flatnonzero(wrong)[0])
            cell = self.columns[column][index]
            found = shown(cell if isinstance(cell, str) else float(cell))
            found = found if str(cell).strip() else "nothing"
            raise self.error(index, column, f"expected a finite number [{unit}], got {found}")
        if blank is not None:
            values[np.isnan(values)] = blank
        return values

    def parsed(self, column: str) -> tuple[Floats, list[int]]:
        """(rows,) numbers, NaN for empty cells, and the rows whose text is no number."""
        cells = self.columns[column]
        if not isinstance(cells, list):
            return np.array(cells, np.float64), []
        try:
            if "_" not in ",".join(cells):  # float() reads 1_000 as a thousand
                return np.fromiter(map(float, cells), np.float64, len(cells)), []
        except ValueError:
            pass
        good = [_is_number(cell) for cell in cells]
        numbers = [float(cell) if ok else math.nan for cell, ok in zip(cells, good, strict=True)]
        bad = [i for i, ok in enumerate(good) if not ok and cells[i].strip()]
        return np.array(numbers), bad


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def read_csv(path: Path, text: Collection[str] = ()) -> Table:
    """A CSV file with a header row; blank lines are skipped, columns without a name left out.

    Args:
        path: the file.
        text: columns that are text even where they look like numbers.
    """
    content = read_text(path)
    if len(content) > _LONG and (columns := plain_columns(content, text)) is not None:
        rows = range(2, 2 + len(next(iter(columns.values()))))
        return Table(str(path), columns, rows)
    with _no_garbage_collection():
        return _read_carefully(path, content)


@contextlib.contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Millions of cells are millions of objects, and none of them is garbage yet."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _read_carefully(path: Path, content: str) -> Table:
    reader = csv.reader(io.StringIO(content, newline=""), strict=True)
    rows: list[int] = []
    cells: list[list[str]] = []
    header: list[str] = []
    try:
        for line in reader:
            if not any(line):
                continue
            if not header:
                header = [plain(name.strip()) for name in line]
                continue
            if len(line) != len(header):
                words = f"expected {len(header)} columns as in the header, got {len(line)}"
                raise fault(path, f"row {reader.line_num}", words)
            rows.append(reader.line_num)
            cells.append(line)
    except csv.Error as error:
        raise fault(path, f"row {reader.line_num}", f"expected CSV, got: {error}") from None
    if not header:
        raise fault(path, "row 1", "expected a header, got an empty file")
    for name in header:
        if name and header.count(name) > 1:
            raise fault(path, f"column {name}", "expected each column once, got it twice")
    transposed = [list(column) for column in zip(*cells, strict=True)] or [[] for _ in header]
    columns: dict[str, list[str] | Floats] = {
        name: column for name, column in zip(header, transposed, strict=True) if name
    }
    return Table(str(path), columns, rows)


def write_csv(columns: Mapping[str, Sequence[str] | Floats], path: Path) -> None:
    """Write columns of one length as CSV, all or nothing.

    Floats are written with as many digits as they need to come back the same, texts so that no
    spreadsheet takes them for a formula; :func:`read_csv` gives them back.
    """
    texts = [
        [_quoted(harmless(cell)) if isinstance(cell, str) else repr(float(cell)) for cell in column]
        for column in columns.values()
    ]
    head = (_quoted(harmless(name)) for name in columns)
    lines = [",".join(head), *map(",".join, zip(*texts, strict=True))]
    write_atomic(path, "".join(f"{line}\n" for line in lines).encode())


def harmless(cell: str) -> str:
    """A text that spreadsheets do not compute: an apostrophe before what begins a formula."""
    return f"'{cell}" if _FORMULA.match(cell) and not _is_number(cell) else cell


def plain(cell: str) -> str:
    """The text that :func:`harmless` was given."""
    return cell[1:] if cell[:1] == "'" and _FORMULA.match(cell[1:]) else cell


def _quoted(cell: str) -> str:
    # The csv module of Python 3.11 leaves a lone carriage return without quotes.
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in '",\r\n') else cell
