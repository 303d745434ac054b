"""Tables of docs/benchmarks.md, written into it from stored `slopewise bench --json` results.

A table on the page is the table that the command shows, made by the same code from the file. It
stands between two comments; where there is no file, what stands there stays:

    <!-- results: cycle -->
    measured so far: …
    <!-- end of results -->

`python docs/site/results.py` writes the tables; `python docs/site/results.py NAME FILE [NOTE]` puts
a result into docs/results before, with date, machine and what a reader has to know about the run.
"""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Callable, Iterable
from datetime import date
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

_PLACE = re.compile(
    r"(?P<begin>^<!-- results: (?P<name>[\w-]+) -->\n)(?P<so_far>.*?)"
    r"(?P<end>^<!-- end of results -->\n)",
    re.DOTALL | re.MULTILINE,
)
_SHOWN = {
    "planner": "benchmarks.planner.planner_speed:show",
    "cycle": "benchmarks.planner.cycle:show",
    "optimality": "benchmarks.planner.optimality:show",
    "closed-loop": "benchmarks.closed_loop.tables:tables",
    "discrepancy": "benchmarks.discovery.tables:tables",
    "fleet": "benchmarks.fleet.fleet:show",
    "obstacles": "benchmarks.obstacles.obstacles:show",
}
"""What makes tables of a result: a function that prints to a screen, or gives them."""
_FACTS = "measured"


class ResultError(Exception):
    """A stored result that the page cannot show."""


class Screen:
    """Takes what a command would print, as Markdown."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def print(self, *things: object, **_: object) -> None:
        """A table, or a line."""
        for thing in things:
            self.parts.append(_table(thing) if isinstance(thing, Table) else _cell(thing))


def filled(page: str, folder: Path) -> str:
    """The page with a table wherever there is a result.

    Raises:
        ResultError: a result has no place, or is not what its benchmark writes now.
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
    """One result as Markdown: when and where measured, then its tables.

    Raises:
        ResultError: names the file, and what is wrong with it.
    """
    if name not in _SHOWN:
        raise ResultError(f"{file}: expected one of {', '.join(_SHOWN)}, got {name}")
    module, function = _SHOWN[name].split(":")
    make: Callable[..., Any] = getattr(import_module(module), function)
    screen = Screen()
    try:
        result = json.loads(file.read_text())
        given = make(result, screen) if function == "show" else make(result)
        for table in given or ():
            screen.print(table)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        words = f"expected what `slopewise bench` writes now, got {type(error).__name__}: {error}"
        raise ResultError(f"{file}: {words}") from error
    return "\n\n".join([_when(result, file), *screen.parts]) + "\n"


def facts() -> dict[str, Any]:
    """Of today and this machine."""
    return {
        "date": f"{date.today()}",
        "version": version("slopewise"),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "python": platform.python_version(),
    }


def _processor() -> str:
    found = re.search(r"^model name\s*: (.*)$", _read(Path("/proc/cpuinfo")), re.MULTILINE)
    return found[1] if found else platform.machine()


def _read(path: Path) -> str:
    return path.read_text() if path.is_file() else ""


def _name(file: Path) -> str:
    return file.stem.replace("_", "-").removeprefix("bench-")


def _when(result: dict[str, Any], file: Path) -> str:
    told = result.get(_FACTS, {})
    parts = ["Small run (`--quick`)" if result.get("quick") else "Measured"]
    if told:
        parts.append(f"on {told['date']} with slopewise {told['version']} on {told['cores']} cores")
        parts.append(f"({told['processor']}, {told['memory'] / 1e9:.0f} GB),")
        parts.append(f"Python {told['python']}")
    if {"sets", "planned"} <= result.keys():
        parts.append(f"({result['sets']} of {result['planned']} sets)")
    note = f" {told['note']}" if told.get("note") else ""
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
    """Text without colours; what is red on a screen is bold."""
    text = value if isinstance(value, Text) else Text.from_markup(str(value))
    plain = " ".join(text.plain.split()).replace("|", "&#124;").replace("<", "&lt;")
    red = any("red" in str(span.style) for span in text.spans)
    return f"**{plain}**" if red and plain else plain


def _keep(name: str, file: Path, folder: Path, note: str = "") -> Path:
    """Put a result where the page finds it."""
    result = json.loads(file.read_text())
    kept = folder / f"{name}.json"
    result[_FACTS] = facts() | ({"note": note} if note else {})
    folder.mkdir(exist_ok=True)
    kept.write_text(json.dumps(result, indent=1, allow_nan=False, ensure_ascii=False) + "\n")
    shown(name, kept)
    return kept


def main(words: list[str]) -> None:
    """Keep a result if one is given, then write all tables into the page."""
    docs = Path(__file__).parents[1]
    if words:
        print(_keep(words[0], Path(words[1]), docs / "results", *words[2:]))
    page = docs / "benchmarks.md"
    page.write_text(filled(page.read_text(), docs / "results"))


if __name__ == "__main__":
    main(sys.argv[1:])
