"""Chosen numbers are in one table, each with unit, meaning and reason."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from slopewise.models import discrepancy
from slopewise.models.discrepancy import thresholds
from slopewise.models.discrepancy.thresholds import Basis

PACKAGE = Path(discrepancy.__file__).parent
MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.name not in ("thresholds.py", "settings.py"))
OF_SINGLE_EFFECTS = {
    "USUAL",
    "_SCALES",
    "_NUMBERS",
    "_LAGS",
    "_COOLING",
    "_WINDS",
    "_HEADINGS",
    "_CAPS",
    "_LEAST_FRICTION",
    "_LATTICE",
    "_RADII",
    "_TRIES",
    "_FEWEST",
    "_STRAIGHT",
}
"""Sizes and grids of one effect, which stand with it."""


def chosen_numbers(path: Path) -> list[str]:
    """Constants of a module that are or hold a number beyond 0, 1 and 2."""
    names = []
    for node in ast.parse(path.read_text()).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
        numbers = [
            n.value
            for n in ast.walk(node.value)
            if isinstance(n, ast.Constant) and isinstance(n.value, int | float)
        ]
        if any(n not in (0, 1, 2) for n in numbers) and not OF_SINGLE_EFFECTS & set(names):
            names += names
    return names


def test_every_threshold_has_its_fields():
    rows = thresholds.table()
    assert len(rows) > 100
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert isinstance(row.basis, Basis), row.name
        assert row.unit, row.name
        assert len(row.moves) > 10, row.name


def test_every_constant_of_the_table_is_a_row():
    constants = {name for name in vars(thresholds) if name.isupper() and not name.startswith("_")}
    assert constants == {row.name for row in thresholds.table()}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_modules_keep_no_numbers_of_their_own(path: Path):
    assert chosen_numbers(path) == []


def test_every_threshold_is_read():
    read = {
        alias.name
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == thresholds.__name__
        for alias in node.names
    }
    assert {row.name for row in thresholds.table()} == read
