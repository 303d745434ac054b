"""How large an installation is, with and without each extra: measured where all are installed.

The table stands in docs/quickstart.md between two comments. `python docs/site/sizes.py` measures
and writes it; a distribution's size is that of all its files, without what Python compiles of them:
pip does so immediately, other installers as modules are imported.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "quickstart.md"
PLACE = re.compile(
    r"(?<=^<!-- sizes -->\n).*?(?=^<!-- end of sizes -->$)", re.DOTALL | re.MULTILINE
)
_NAMED = 3


@cache
def project() -> dict[str, Any]:
    """The table of pyproject.toml."""
    table: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return table


def extras() -> list[str]:
    """Those that users install."""
    return [name for name in project()["optional-dependencies"] if name != "dev"]


@cache
def brought(*chosen: str) -> frozenset[str]:
    """Distributions that an installation with these extras brings, itself excluded."""
    lines = [*project()["dependencies"]]
    for extra in chosen:
        lines += project()["optional-dependencies"][extra]
    seen: set[tuple[str, str]] = set()
    left = [(Requirement(line), "") for line in lines]
    while left:
        requirement, asked_for = left.pop()
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": asked_for}):
            continue
        name = canonicalize_name(requirement.name)
        for extra in ("", *sorted(requirement.extras)):
            if (name, extra) in seen:
                continue
            seen.add((name, extra))
            left += [(Requirement(line), extra) for line in _needs(name)]
    return frozenset(name for name, _ in seen)


def _needs(name: str) -> list[str]:
    try:
        return distribution(name).requires or []
    except PackageNotFoundError:
        return []


@cache
def size(name: str) -> float:
    """Of a distribution's files [MB]; 0 where it is not installed."""
    try:
        return _size(distribution(name))
    except PackageNotFoundError:
        return 0.0


def _size(package: Distribution) -> float:
    files = [Path(str(file.locate())) for file in package.files or ()]
    counted = [file for file in files if file.suffix != ".pyc" and file.is_file()]
    return sum(file.stat().st_size for file in counted) / 1e6


def table() -> str:
    """Size of a plain install, and of each extra in addition."""
    core = brought()
    rows = [_row("none, a plain install", core)]
    rows += [_row(f"`{extra}`", brought(extra) - core, "+ ") for extra in extras()]
    head = "| extra | MB on disk | most of it |\n|---|--:|---|\n"
    return f"\n{head}" + "\n".join(rows) + "\n\n"


def _row(name: str, names: frozenset[str], sign: str = "") -> str:
    largest = sorted(names, key=size, reverse=True)[:_NAMED]
    parts = ", ".join(f"{part} {size(part):.0f}" for part in largest if size(part) >= 1.0)
    return f"| {name} | {sign}{sum(map(size, names)):.0f} | {parts or 'nothing'} |"


def main() -> None:
    """Measure, and write the table into the page."""
    PAGE.write_text(PLACE.sub(lambda _: table(), PAGE.read_text()))


if __name__ == "__main__":
    main()
