"""Tables with a header: CSV in and out, Parquet in; numbers are checked cell by cell."""

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
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError
from slopewise.services.io.files import check_file, fault, read_text, shown, write_atomic

_FORMULA = re.compile(r"'*[=+\-@\t\r]")

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+(?:,\d+)+\s*")
_SEPARATORS = {";": "semicolons", "\t": "tabs", " ": "spaces"}
"""Marks between columns of other programs, and of countries with decimal commas."""

_LONG = 1_000_000
"""Characters from which the fast path is worth trying: the careful one takes 60 ms for as many."""


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of a file by name, in the file's order."""

    source: str
    columns: dict[str, list[str] | Floats]  # cells as text, or numbers where the format has them
    rows: Sequence[int]  # number of each row in the file; a CSV's header is row 1, Parquet from 1

    def error(self, index: int, column: str, expected: str) -> InputError:
        """An InputError at a cell; ``index`` counts the rows from 0."""
        return fault(self.source, f"row {self.rows[index]}, column {column}", expected)

    def require(self, columns: Iterable[str], purpose: str = "") -> None:
        """Raise InputError unless the table has all these columns, and at least one row."""
        missing = [name for name in columns if name not in self.columns]
        if missing:
            field = ", ".join(f"column {name}" for name in missing)
            expected = self._missing(missing)
            raise fault(self.source, field, f"{expected}; {purpose}" if purpose else expected)
        if not len(self.rows):
            raise fault(self.source, "row 2", "expected at least one row, got the header only")

    def _missing(self, names: Sequence[str]) -> str:
        header = list(self.columns)
        several = len(names) > 1
        message = f"missing column{'s' if several else ''}, got the header {','.join(header)}"
        if hint := _separator_hint(header):
            return f"{message}{hint}"
        if all(_is_number(column) for column in header):
            return f"{message}; expected names in the first row"
        lower = {column.lower(): column for column in header}
        for name in names:
            if close := difflib.get_close_matches(name, lower, n=1):
                message += f"; is {name if several else 'it'} {lower[close[0]]}?"
        return message

    def text(self, column: str) -> list[str]:
        """Cells as text; whole numbers without a decimal point."""
        cells = self.columns[column]
        if isinstance(cells, list):
            return [plain(cell) for cell in cells]
        return ["" if math.isnan(c) else repr(c).removesuffix(".0") for c in cells.tolist()]

    def numbers(self, column: str, unit: str, *, blank: float | None = None) -> Floats:
        """(rows,) finite numbers; ``blank``: stands for an empty cell or NaN; None refuses them."""
        values, texts = self.parsed(column)
        wrong = ~np.isfinite(values) if blank is None else np.isinf(values)
        wrong[list(texts)] = True
        if wrong.any():
            index = int(np.flatnonzero(wrong)[0])
            cell = self.columns[column][index]
            got = shown(cell if isinstance(cell, str) else float(cell))
            got = got if str(cell).strip() else "nothing"
            hint = "; expected a decimal point" if _DECIMAL_COMMA.fullmatch(str(cell)) else ""
            raise self.error(index, column, f"expected a finite number [{unit}], got {got}{hint}")
        if blank is not None:
            values[np.isnan(values)] = blank
        return values

    def parsed(self, column: str) -> tuple[Floats, list[int]]:
        """(rows,) numbers, NaN for empty cells, and the rows whose text is not a number."""
        cells = self.columns[column]
        if not isinstance(cells, list):
            return np.array(cells, np.float64), []
        try:
            if "_" not in ",".join(cells):  # float() reads 1_000 as a thousand
                return np.fromiter(map(float, cells), np.float64, len(cells)), []
        except ValueError:
            pass
        numeric = [_is_number(cell) for cell in cells]
        numbers = [float(c) if ok else math.nan for c, ok in zip(cells, numeric, strict=True)]
        texts = [i for i, ok in enumerate(numeric) if not ok and cells[i].strip()]
        return np.array(numbers), texts

    def rows_by_candidate(self) -> dict[str, list[int]]:
        """Rows of each name in the column `candidate`; without it all, under the file's name."""
        if "candidate" not in self.columns:
            return {Path(self.source).stem: list(range(len(self.rows)))}
        candidates: dict[str, list[int]] = {}
        for index, name in enumerate(self.text("candidate")):
            if not name.strip():
                raise self.error(index, "candidate", "expected a name, got nothing")
            candidates.setdefault(name, []).append(index)
        return candidates

    def all_or_none(
        self, column: str, values: Floats, rows: list[int], name: str, unit: str
    ) -> Floats | None:
        """Values of a candidate's rows, None if all of them are NaN; some of them are a fault."""
        missing = np.isnan(values[rows])
        if missing.all():
            return None
        if missing.any():
            expected = f"expected a number [{unit}] in every row of {name} or in none"
            raise self.error(rows[int(np.argmax(missing))], column, f"{expected}, got nothing")
        return values[rows]


def _separator_hint(header: Sequence[str]) -> str:
    """Hint at columns that other marks than commas separate, "" for none."""
    marks = [noun for mark, noun in _SEPARATORS.items() if len(header) == 1 and mark in header[0]]
    return f"; expected commas between columns, got {marks[0]}" if marks else ""


def _decimal_hint(header: Sequence[str], line: Sequence[str]) -> str:
    """Hint at decimal commas in a row of numbers, "" for none."""
    has_more = len(line) > len(header) and all(map(_is_number, line))
    return "; expected decimal points, not commas" if has_more else ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def read_table(path: Path, text: Collection[str] = ()) -> Table:
    """A table: Parquet if the file is called so, else CSV; see :func:`read_csv`."""
    is_parquet = path.suffix.lower() in (".parquet", ".pq")
    return read_parquet(path) if is_parquet else read_csv(path, text)


def read_csv(path: Path, text: Collection[str] = ()) -> Table:
    """A CSV file with a header row; blank lines and columns without a name are skipped.

    Columns of ``text`` are text even where they look like numbers.
    """
    content = read_text(path)
    if len(content) > _LONG and (columns := _fast_columns(content, text)) is not None:
        rows = range(2, 2 + len(next(iter(columns.values()))))
        return Table(str(path), columns, rows)
    with _no_garbage_collection():
        return _read_carefully(path, content)


def _fast_columns(content: str, text: Collection[str]) -> dict[str, list[str] | Floats] | None:
    """Columns by numpy's reader; None where the careful reader could read a cell differently.

    That is a file with quotes, lone carriage returns, blank lines or lines of another length, or
    with a blank cell in a column of numbers.
    """
    head, _, body = content.replace("\r\n", "\n").partition("\n")
    names = [plain(name.strip()) for name in head.split(",")]
    if any(mark in content for mark in '"\0') or "\r" in body or "" in names:
        return None
    lines = body.removesuffix("\n").split("\n")
    if len(set(names)) < len(names) or {line.count(",") for line in lines} != {len(names) - 1}:
        return None
    cells = [_is_number(cell) for cell in lines[0].split(",")]
    numeric = [k for k, name in enumerate(names) if cells[k] and name not in text]
    if not numeric or "" in lines:
        return None
    try:
        values = np.loadtxt(lines, delimiter=",", comments=None, usecols=numeric, ndmin=2)
    except ValueError:
        return None
    finite = {numeric[i] for i in np.flatnonzero(np.isfinite(values).all(axis=0))}
    return {
        name: np.ascontiguousarray(values[:, numeric.index(k)])
        if k in finite
        else [line.split(",", k + 1)[k] for line in lines]
        for k, name in enumerate(names)
    }


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
                expected = f"expected {len(header)} columns as in the header, got {len(line)}"
                hint = _separator_hint(header) or _decimal_hint(header, line)
                raise fault(path, f"row {reader.line_num}", f"{expected}{hint}")
            rows.append(reader.line_num)
            cells.append(line)
    except csv.Error as error:
        raise fault(path, f"row {reader.line_num}", f"expected CSV, got: {error}") from None
    if not header:
        raise fault(path, "row 1", "expected a header, got an empty file")
    _check_unique(path, header)
    transposed = [list(column) for column in zip(*cells, strict=True)] or [[] for _ in header]
    columns: dict[str, list[str] | Floats] = {
        name: column for name, column in zip(header, transposed, strict=True) if name
    }
    return Table(str(path), columns, rows)


def _check_unique(path: Path, header: Sequence[str]) -> None:
    for name in header:
        if name and header.count(name) > 1:
            raise fault(path, f"column {name}", "expected each column once, got it twice")


def read_parquet(path: Path) -> Table:
    """A Parquet file: numbers as float64 with NaN for null, all else as text."""
    check_file(path)
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        hint = "expected pyarrow to read Parquet, got none: pip install '.[parquet]' in a clone"
        raise fault(path, "", hint) from None
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            read = file.read()
        _check_unique(path, read.column_names)
        columns = {name: _cells(pyarrow, read[name]) for name in read.column_names}
    except (pyarrow.ArrowException, OSError):
        raise fault(path, "", "expected an intact Parquet file, got something else") from None
    return Table(str(path), columns, range(1, len(read) + 1))


def _cells(pyarrow: Any, column: Any) -> list[str] | Floats:
    types, kind = pyarrow.types, column.type
    if types.is_boolean(kind):
        column, kind = column.cast(pyarrow.uint8()), pyarrow.uint8()
    # Decimals are exact as text.
    if types.is_integer(kind) or types.is_floating(kind) or types.is_null(kind):
        numbers = column.cast(pyarrow.float64(), safe=False).to_numpy()  # null becomes NaN
        return np.array(numbers, np.float64)
    # Python's times have microseconds.
    if types.is_timestamp(kind) and kind.unit == "ns":
        column = column.cast(pyarrow.timestamp("us", kind.tz), safe=False)
    elif types.is_duration(kind) and kind.unit == "ns":
        column = column.cast(pyarrow.duration("us"), safe=False)
    return ["" if cell is None else str(cell) for cell in column.to_pylist()]


def write_csv(columns: Mapping[str, Sequence[str] | Floats], path: Path) -> None:
    """Write columns of one length as CSV, all or nothing.

    Floats are written with as many digits as they need to come back the same, texts so that no
    spreadsheet takes them for a formula; :func:`read_csv` gives them back.
    """
    texts = [
        map(repr, column.astype(np.float64).tolist())
        if isinstance(column, np.ndarray) and column.dtype.kind in "fiub"
        else [_text(cell) if isinstance(cell, str) else repr(float(cell)) for cell in column]
        for column in columns.values()
    ]
    lines = [",".join(map(_text, columns)), *map(",".join, zip(*texts, strict=True))]
    write_atomic(path, "".join(f"{line}\n" for line in lines).encode())


def write_rows(
    rows: Sequence[Mapping[str, Any]], names: Iterable[str], texts: Collection[str], path: Path
) -> None:
    """Write the columns of some names, blank or NaN where a row has no value; all or nothing."""
    columns: dict[str, list[str] | Floats] = {
        name: [str(row.get(name, "")) for row in rows]
        if name in texts
        else np.array([row.get(name, np.nan) for row in rows], np.float64)
        for name in names
    }
    write_csv(columns, path)


def harmless(cell: str) -> str:
    """A text that spreadsheets do not compute: an apostrophe before what begins a formula."""
    return f"'{cell}" if _FORMULA.match(cell) and not _is_number(cell) else cell


def plain(cell: str) -> str:
    """The text that :func:`harmless` was given."""
    return cell[1:] if cell[:1] == "'" and _FORMULA.match(cell[1:]) else cell


@lru_cache(maxsize=1024)  # names of runs are in every row
def _text(cell: str) -> str:
    cell = harmless(cell)
    # The csv module of Python 3.11 leaves a lone carriage return without quotes.
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in '",\r\n') else cell
