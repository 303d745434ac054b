"""Every package keeps to its budget of lines, and returns lines that it no longer needs.

Budgets stand in `pyproject.toml`, `[tool.slopewise.budgets]`. Lines are counted as the formatter
leaves them, docstrings and page scripts included. A commit that raises a
budget gives the reason; one that needs less lowers it.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.world.sources import ROOT, sources

BUDGETS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["slopewise"]["budgets"]
PACKAGES: dict[str, int] = BUDGETS["packages"]
COUNTED = {".py", ".js", ".cpp", ".hpp"}
SLACK = 60
"""Lines that a package may stay below its budget: less work than a budget for each small commit."""

MAX_FILE, MAX_FUNCTION = 350, 40
"""Lines of a file, and lines of code of a function, without docstring and blank lines."""


def files_of(package: str) -> list[Path]:
    folder = ROOT / package
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix in COUNTED
        and not file.name.endswith(".min.js")  # a library of others
        and "__pycache__" not in file.parts
        # Links of the namespace package are counted in their targets.
        and not any((ROOT / package / part).is_symlink() for part in file.relative_to(folder).parts)
    )


def lines_of(file: Path) -> int:
    return len(file.read_text(encoding="utf-8").splitlines())


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_keeps_to_its_budget(package: str) -> None:
    used = sum(lines_of(file) for file in files_of(package))
    assert used <= PACKAGES[package], (
        f"{package} has {used} lines: delete, or raise its budget and say why"
    )
    assert used >= PACKAGES[package] - SLACK, (
        f"{package} has {used} lines only: lower its budget to that"
    )


def test_every_package_has_a_budget() -> None:
    services = {f"services/{f.name}" for f in (ROOT / "services").iterdir() if f.is_dir()}
    services -= {"services/__pycache__"}
    packages = {"planner", "models", "slopewise", "benchmarks", "tests"}
    assert set(PACKAGES) == packages | services


def test_files_and_functions_stay_short() -> None:
    files = [file for package in PACKAGES for file in files_of(package)]
    functions = [sources()[str(f.relative_to(ROOT))] for f in files if f.suffix == ".py"]
    lengths = [length for source in functions for length in source.code_lines]
    assert sum(lines_of(file) > MAX_FILE for file in files) == BUDGETS["files_over_350_lines"]
    assert sum(n > MAX_FUNCTION for n in lengths) == BUDGETS["functions_over_40_lines"]


def test_no_line_is_hidden_from_the_formatter() -> None:
    marks = ("fmt: " + "skip", "fmt: " + "off")
    hidden = [
        f"{file.relative_to(ROOT)}: {mark}"
        for package in PACKAGES
        for file in files_of(package)
        for mark in marks
        if mark in file.read_text(encoding="utf-8")
    ]
    assert not hidden
