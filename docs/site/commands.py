"""The reference of the command line, made from the commands themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from slopewise.services.cli.app import app

_MARKUP = re.compile(r"\[/?[a-z]*\]")
_STATUS = """
## Exit status

| status | means |
|---|---|
| 0 | done |
| 1 | a fault of the program; `SLOPEWISE_DEBUG=1` shows where |
| 2 | an input is wrong: one line on standard error names file and field, and what was expected |
| 3 | no candidate may be driven |
"""


def page() -> str:
    """All commands with their arguments and options."""
    group: Any = typer.main.get_command(app)
    parts = [
        "# Commands\n",
        "Every command has `--help`; most print machine-readable JSON with `--json`.\n",
    ]
    for name, command in _commands(group):
        parts.append(f"## slopewise {name}\n")
        parts.append(_plain(command.help or "") + "\n")
        rows = [_row(parameter) for parameter in command.params if parameter.name != "help"]
        parts.append("| option | default | description |\n|---|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join([*parts, _STATUS])


def _commands(group: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Commands by their full name, those of a group under the group's."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def _row(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        label = parameter.metavar or parameter.name.upper()
        text = getattr(parameter, "help", "") or ""
    else:
        metavar = "" if parameter.is_flag else f" {parameter.metavar or 'VALUE'}"
        label = " / ".join([*parameter.opts, *parameter.secondary_opts]) + metavar
        text = parameter.help or ""
    default = parameter.default
    is_plain = not parameter.required and default not in (None, "") and parameter.show_default
    shown = f"`{default}`" if is_plain else ""
    return f"| `{label}` | {shown} | {_plain(text).replace('|', '&#124;')} |"


def _plain(text: str) -> str:
    text = text.replace("\b", "").replace(r"\[", "\0")
    text = re.sub(r"\[bold\](.*?)\[/\]", r"**\1**", text)
    return _MARKUP.sub("", text).replace("\0", "[").strip()
