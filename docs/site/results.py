"""Tables of docs/benchmarks.md, written into it from stored `slopewise bench --json` results.

A table on the page is the table that the command shows, made by the same code from the file. It
stands between two comments; without a file the page stays unchanged there:

    <!-- results: cycle -->
    measured so far: …
    <!-- end of results -->

`python docs/site/results.py` writes the tables; `python docs/site/results.py NAME FILE [NOTE]` puts
a result into docs/results before, with date, machine and a note on the run.
"""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Iterable
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from benchmarks.__main__ import BENCHMARKS, benchmark
from benchmarks.common.timing import processor

_PLACE = re.compile(
    r"(?P<begin>^<!-- results: (?P<name>[\w-]+) -->\n)(?P<so_far>.*?)"
    r"(?P<end>^<!-- end of results -->\n)",
    re.DOTALL | re.MULTILINE,
)
_FACTS = "measured"


class ResultError(Exception):
    """A stored result that the page cannot show."""


class ResultTable:
    """Collects the output of a command as Markdown."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def print(self, *things: object, **_: object) -> None:
        """Add tables or lines."""
        for thing in things:
            self.parts.append(_table(thing) if isinstance(thing, Table) else _cell(thing))


def filled(page: str, folder: Path) -> str:
    """Fill the page with the tables of all results.

    Raises:
        ResultError: a result has no place, or another form than its benchmark writes now.
    """
    files = {_name(file): file for file in sorted(folder.glob("*.json"))}
    places = {match["name"] for match in _PLACE.finditer(page)}
    if lost := sorted(files.keys() - places):
        raise ResultError(f"{files[lost[0]]}: expected a place for {lost[0]} on the page, got none")

    def put(match: re.Match[str]) -> str:
        file = files.get(match["name"])
        if file is None:
            return match[0]
        return f"{match['begin']}\n{shown(match['name'], file)}\n{match['end']}"

    return _PLACE.sub(put, page)


def shown(name: str, file: Path) -> str:
    """One result as Markdown: time and machine, then its tables.

    Raises:
        ResultError: names the file and its fault.
    """
    if name not in BENCHMARKS:
        raise ResultError(f"{file}: expected one of {', '.join(BENCHMARKS)}, got {name}")
    screen = ResultTable()
    try:
        result = json.loads(file.read_text())
        benchmark(name).show(result, screen)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        fault = f"{type(error).__name__}: {error}"
        expected = "expected the form that `slopewise bench` writes now"
        raise ResultError(f"{file}: {expected}, got {fault}") from error
    return "\n\n".join([_when(result, file), *screen.parts]) + "\n"


def facts() -> dict[str, Any]:
    """Date, version and machine."""
    return {
        "date": f"{date.today()}",
        "version": version("slopewise"),
        "processor": processor(),
        "cores": os.cpu_count(),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "python": platform.python_version(),
    }


def _name(file: Path) -> str:
    return file.stem.replace("_", "-").removeprefix("bench-")


def _when(result: dict[str, Any], file: Path) -> str:
    measured = result.get(_FACTS, {})
    parts = ["Small run (`--quick`)" if result.get("quick") else "Measured"]
    if measured:
        parts.append(f"on {measured['date']} with slopewise {measured['version']}")
        parts.append(f"on {measured['cores']} cores")
        parts.append(f"({measured['processor']}, {measured['memory'] / 1e9:.0f} GB),")
        parts.append(f"Python {measured['python']}")
    if {"sets", "planned"} <= result.keys():
        parts.append(f"({result['sets']} of {result['planned']} sets)")
    note = f" {measured['note']}" if measured.get("note") else ""
    return f"{' '.join(parts)}: [all figures](results/{file.name}).{note}"


def _table(table: Table) -> str:
    heads = [_cell(column.header) or " " for column in table.columns]
    if not any(head.strip() for head in heads):
        heads[0] = "what"
    ends = ["--:" if column.justify == "right" else "---" for column in table.columns]
    rows = zip(*(map(_cell, column.cells) for column in table.columns), strict=True)
    lines = [_line(heads), _line(ends), *map(_line, rows)]
    title = f"**{_cell(table.title)}**\n\n" if table.title else ""
    return title + "\n".join(lines)


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(value: object) -> str:
    """Text without colours; red text becomes bold."""
    text = value if isinstance(value, Text) else Text.from_markup(str(value))
    plain = " ".join(text.plain.split()).replace("|", "&#124;").replace("<", "&lt;")
    red = any("red" in str(span.style) for span in text.spans)
    return f"**{plain}**" if red and plain else plain


def _keep(name: str, file: Path, folder: Path, note: str = "") -> Path:
    """Store a result for the page."""
    result = json.loads(file.read_text())
    stored = folder / f"{name}.json"
    result[_FACTS] = facts() | ({"note": note} if note else {})
    folder.mkdir(exist_ok=True)
    stored.write_text(json.dumps(result, indent=1, allow_nan=False, ensure_ascii=False) + "\n")
    shown(name, stored)
    return stored


def main(arguments: list[str]) -> None:
    """Store a result if one is given, then write all tables into the page."""
    docs = Path(__file__).parents[1]
    if arguments:
        print(_keep(arguments[0], Path(arguments[1]), docs / "results", *arguments[2:]))
    page = docs / "benchmarks.md"
    page.write_text(filled(page.read_text(), docs / "results"))


if __name__ == "__main__":
    main(sys.argv[1:])
