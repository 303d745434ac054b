"""Exit status, printed result and schema of a command.

A command is a typer function that returns an :class:`ExitStatus`, or None for 0; it is listed in
`slopewise.services.cli.app`. It imports what it works with when it runs, so that `--help` is fast.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from datetime import datetime
from enum import IntEnum
from importlib import import_module
from pathlib import Path
from typing import Any

import typer


class ExitStatus(IntEnum):
    """Exit status of the program."""

    DONE = 0
    FAULT = 1
    BAD_INPUT = 2
    NOT_ADMISSIBLE = 3  # no plan may be driven, a check found something, a result is not usable
    UNDECIDED = 4  # too few stops
    STOPPED = 130


def schema_of(summary: str) -> Any:
    """The option `--json-schema` of a command; summary: MODULE.TYPE of the services' results."""

    def print_schema(is_asked: bool) -> None:
        if is_asked:
            import msgspec

            module, _, kind = summary.rpartition(".")
            summary_type = getattr(import_module(f"slopewise.services.{module}"), kind)
            typer.echo(json.dumps(msgspec.json.schema(summary_type), indent=1))
            raise typer.Exit

    return typer.Option(
        "--json-schema", is_eager=True, callback=print_schema, help="Print the schema of --json."
    )


def print_result(
    as_json: bool, summary: object, tables: Iterable[Any], *files: Path | None
) -> None:
    """Print a result: as JSON; or as tables, then the files that were written."""
    if as_json:
        from slopewise.services.jobs.summary import to_json

        typer.echo(to_json(summary))
        return
    from rich.console import Console

    console = Console()
    for part in tables:
        console.print(part)
    for file in filter(None, files):
        typer.echo(f"wrote {file}")


def print_ready(as_json: bool, message: str, facts: dict[str, object]) -> None:
    """Print the line of a command that runs until a signal, for the process that waits for it."""
    print(json.dumps({"ready": True, **facts}) if as_json else f"slopewise: {message}", flush=True)


def provenance_of(logs: Sequence[Path], model: str, **facts: str) -> dict[str, str]:
    """Facts on a page about drive logs: name -> value."""
    return {
        "logs": ", ".join(log.name for log in logs),
        "model so far": model,
        **facts,
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
