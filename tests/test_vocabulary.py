"""Names and prose keep to the field's words; `vocabulary.toml` lists those to avoid.

Names are those of modules, classes, functions, arguments and variables. Prose is docstrings,
comments, messages and help, and the pages of docs without code. Packages whose redesign is still to
come have a ceiling, which may only fall.
"""

from __future__ import annotations

import io
import re
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.world.sources import FOLDERS, ROOT, sources

LISTS: dict[str, dict[str, str]] = tomllib.loads((ROOT / "tests" / "vocabulary.toml").read_text())
AVOIDED = {
    scope: [(re.compile(pattern, re.IGNORECASE), instead) for pattern, instead in table.items()]
    for scope, table in LISTS.items()
}
ANY = {
    scope: re.compile("|".join([*LISTS[scope], *LISTS["names_and_prose"]]), re.IGNORECASE)
    for scope in LISTS
}
MARKER = "words: ok"
CEILINGS: dict[str, int] = {"models/discrepancy": 6, "planner": 8}
"""Matches in folders that are not at zero yet."""


def split_name(name: str) -> str:
    """Return the lower-case words of an identifier: ``StopRecord`` is "stop record"."""
    spaced = re.sub(r"([a-z0-9])([A-Z])|([A-Z])(?=[A-Z][a-z])", r"\1\3 \2", name)
    return re.sub(r"[\s_-]+", " ", spaced).strip().lower()


def python_items(file: Path, source: str) -> Iterator[tuple[str, int, int, str]]:
    """Yield scope, first line, last line and text of all names and prose."""
    surveyed = sources()[file.relative_to(ROOT).as_posix()]
    names = {split_name(file.stem): 1}
    for name, line in surveyed.names.items():
        names.setdefault(split_name(name), line)
    yield from surveyed.texts
    # Tokens take longest: only where what follows a # in some line would match.
    if any(ANY["prose"].search(line) for line in re.findall("#.*", source)):
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                yield "prose", token.start[0], token.start[0], token.string
    yield from (("names", line, line, name) for name, line in names.items())


def page_items(source: str) -> Iterator[tuple[str, int, int, str]]:
    is_code = False
    for number, line in enumerate(source.split("\n"), 1):
        is_code ^= line.startswith("```")
        if not is_code:
            yield "prose", number, number, line


def matches(file: Path) -> list[str]:
    source = file.read_text(encoding="utf-8")
    excepted = [MARKER in line for line in source.split("\n")]
    items = python_items(file, source) if file.suffix == ".py" else page_items(source)
    hits = []
    for scope, first, last, text in items:
        if excepted[first - 1] or excepted[last - 1]:
            continue
        plain = re.sub("`+[^`]*`+", "`", text)  # names in code are checked where they are defined
        if not ANY[scope].search(plain):
            continue
        tables = [AVOIDED[scope]] + ([AVOIDED["names_and_prose"]] if scope != "first_line" else [])
        for avoided, instead in (pair for table in tables for pair in table):
            hits += [f"{file}:{first}: {m[0]} -> {instead}" for m in avoided.finditer(plain)]
    return hits


def files_of(folder: str) -> Iterator[Path]:
    inner = [name for name in CEILINGS if name.startswith(folder + "/")]
    for file in sorted((ROOT / folder).rglob("*")):
        place = file.relative_to(ROOT).as_posix()
        if file.suffix in {".py", ".md"} and not place.startswith(tuple(f"{i}/" for i in inner)):
            yield file


def test_the_readme_keeps_to_the_vocabulary() -> None:
    assert matches(ROOT / "README.md") == []


@pytest.mark.parametrize("folder", [*FOLDERS, *(f for f in CEILINGS if f not in FOLDERS)])
def test_a_folder_keeps_to_the_vocabulary(folder: str) -> None:
    hits = [hit for file in files_of(folder) for hit in matches(file)]
    ceiling = CEILINGS.get(folder, 0)
    assert len(hits) <= ceiling, "\n".join(hits[:40])
    assert len(hits) > ceiling - 20 or ceiling == 0, f"lower the ceiling of {folder} to {len(hits)}"
