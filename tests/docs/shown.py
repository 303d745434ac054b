"""Commands that a page shows, and the folder where they run, with the extras installed there.

All extras are installed here, so a start-up file hides each module that neither the core nor the
extras on the page bring.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import typer
from packaging.utils import canonicalize_name

from slopewise.services.cli.app import app

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "site"))

import sizes  # noqa: E402

BOX = re.compile(r"^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
PROGRAMS = ("slopewise", "python", "make", "pip")
HIDE = """
import os, sys
for name in os.environ.get("HIDDEN_MODULES", "").split(","):
    sys.modules[name] = None
"""


@dataclass(frozen=True)
class Shown:
    """A command as it stands on a page, without its comment.

    Attributes:
        section: title above it. extras: those that the lines above it in its box install.
    """

    line: str
    section: str
    extras: tuple[str, ...] = ()

    @property
    def arguments(self) -> list[str]:
        return self.line.split()


def shown(page: str) -> list[Shown]:
    """Every command in a box without a language, in order; what a box installs holds in it."""
    commands = []
    for section in re.split(r"^## ", page, flags=re.MULTILINE):
        title = section.split("\n", 1)[0]
        for box in BOX.finditer(section):
            if box["kind"]:
                continue
            extras: tuple[str, ...] = ()
            for text in box["text"].splitlines():
                line = re.sub(r"\s+#\s.*$", "", text).strip()
                if line.split()[:1] and line.split()[0] in PROGRAMS:
                    extras += extras_of(line)
                    commands.append(Shown(line, title, extras))
    return commands


def extras_of(line: str) -> tuple[str, ...]:
    """Extras that a line installs from the clone."""
    match = re.match(r"pip install '\.\[([\w,]+)\]'$", line)
    return tuple(match[1].split(",")) if match else ()


def in_text(page: str) -> list[str]:
    """Commands with arguments in running text, outside a box."""
    names = command_names()
    text = BOX.sub("", page)
    commands = re.findall(r"`(slopewise [^`]+)`", text)
    return [line for line in commands if line.removeprefix("slopewise ") not in names]


@cache
def command_names() -> frozenset[str]:
    """All commands, and the groups that hold some."""

    def names(group: object, before: str = "") -> Iterator[str]:
        for name, command in getattr(group, "commands", {}).items():
            yield f"{before}{name}"
            yield from names(command, f"{before}{name} ")

    return frozenset(names(typer.main.get_command(app)))


_modules = cache(packages_distributions)


def hidden(extras: Sequence[str] = ()) -> list[str]:
    """Modules that a plain install with these extras does not bring."""
    # An editable install lists its own modules, too.
    distributions = sizes.brought(*extras) | {sizes.project()["name"]}
    return sorted(
        module
        for module, names in _modules().items()
        if module.isidentifier()
        and not any(canonicalize_name(name) in distributions for name in names)
    )


def environment(folder: Path, extras: Sequence[str] = ()) -> dict[str, str]:
    """For commands in a folder: the clone is reachable, other extras are hidden."""
    (folder / "sitecustomize.py").write_text(HIDE)
    return os.environ | {
        "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}",
        "HIDDEN_MODULES": ",".join(hidden(extras)),
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}",
        "COLUMNS": "80",
    }
