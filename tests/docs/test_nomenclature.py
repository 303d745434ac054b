"""Signatures keep to docs/nomenclature.md: words, not letters, and no retired word anywhere."""

from __future__ import annotations

import ast
import dataclasses
import re
from collections.abc import Iterator
from functools import cache

import pytest

from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Braking, Limits, Terrain
from slopewise.models.vehicle import Vehicle
from tests.world.sources import ROOT, sources

PAGE = (ROOT / "docs" / "nomenclature.md").read_text()
RETIRED = "Words that are retired"
SPELLED = "alpha beta delta d epsilon theta kappa mu sigma tau phi psi omega 0 _sq"
GREEK = dict(zip("αβδΔεθκμστφψω₀²", SPELLED.split(), strict=True))
SUFFIXES = ("deg", "kmh", "km", "mm", "cm", "percent")


def table(title: str) -> list[list[str]]:
    """Rows of the table below a title."""
    text = PAGE.split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def titles() -> list[str]:
    return [t for t in re.findall(r"^## (.+)$", PAGE, re.MULTILINE) if t != RETIRED]


def letters() -> dict[str, str]:
    """Letters of the papers, as an identifier would spell them -> the name to use."""
    rows = [row for title in titles() for row in table(title)]
    names = {name for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    names |= {name for law in LAWS.values() for name in law.parameters}
    units = {}
    for row in rows:
        symbols = re.findall(r"`(\w+)`", row[0])
        for letter in re.split(r"[,/] ?| in \w+", row[1]):
            term = "".join(GREEK.get(c, c) for c in letter.strip())
            if symbols and term.isidentifier() and term not in names:
                units.setdefault(term, symbols[0])
    return units


def retired() -> dict[str, tuple[str, set[str]]]:
    """Retired word -> what to say instead, and the names in which the word is all right."""
    return {
        term: (row[1], set(re.findall(r"`(\w+)`", row[2])))
        for row in table(RETIRED)
        for term in re.findall(r"`(\w+)`", row[0])
    }


def trees(*folders: str) -> Iterator[tuple[str, ast.Module]]:
    for file in (file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))):
        yield str(file.relative_to(ROOT)), ast.parse(file.read_text())


def compiled(function: ast.FunctionDef) -> bool:
    """A kernel: the inside of a law, where letters belong."""
    return any(
        isinstance(d, ast.Name) and d.id in ("kernel", "inlined", "row_pass")
        for d in function.decorator_list
    )


def public_parameters() -> Iterator[tuple[str, str]]:
    for file, tree in trees("slopewise", "models", "planner"):
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for node in (*tree.body, *(inner for kind in classes for inner in kind.body)):
            if not isinstance(node, ast.FunctionDef) or compiled(node):
                continue
            if node.name.startswith("_") and node.name != "__init__":
                continue
            given = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            yield from ((f"{file}: {node.name}", argument.arg) for argument in given)


@cache
def defined() -> dict[str, set[str]]:
    """Every name that product code gives to something, and the files where it does."""
    folders = ("slopewise/", "models/", "planner/", "services/")
    files: dict[str, set[str]] = {}
    for file, source in sources().items():
        for name in source.names if file.startswith(folders) else ():
            files.setdefault(name, set()).add(file)
    return files


@cache
def parts(name: str) -> str:
    """A name as words between underscores: ``_DeadTime`` is ``_dead_time_``."""
    split = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return f"_{split.lower().strip('_')}_"


def contains_term(term: str, name: str) -> bool:
    """A word with an underscore behind it is retired as the beginning of a name only."""
    if term.endswith("_"):
        return re.match(f"_{term}[a-z]", parts(name)) is not None
    return f"_{term}_" in parts(name)


def test_public_signatures_use_no_bare_letters_and_si_units() -> None:
    expected, given = letters(), list(public_parameters())
    assert len(expected) > 20
    assert len(retired()) > 10
    wrong = [f"{at}({name}): {expected[name]}" for at, name in given if name in expected]
    suffixes = tuple(f"_{suffix}_" for suffix in SUFFIXES)
    wrong += [f"{at}({name}): SI" for at, name in given if parts(name).endswith(suffixes)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("kind", [Vehicle, Braking, Terrain, Limits])
def test_every_key_of_a_model_file_is_documented(kind: type) -> None:
    rows = [row for title in titles() for row in table(title)]
    documented = {name for row in rows for cell in row for name in re.findall(r"`(\w+)`", cell)}
    expected = {field.name for field in dataclasses.fields(kind)}
    assert not expected - documented


@pytest.mark.parametrize("term", sorted(retired()))
def test_a_retired_term_names_no_identifier(term: str) -> None:
    instead, fine = retired()[term]
    names = [n for n in defined() if contains_term(term, n) and n not in fine]
    wrong = sorted(f"{file}: {name}" for name in names for file in defined()[name])
    assert not wrong, f"say {instead}:\n" + "\n".join(wrong)
