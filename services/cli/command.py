"""Exit status, printed result and schema of a command.

A command is a typer function that returns an :class:`ExitStatus`, or None for 0; it is listed in
`slopewise.services.cli.app`. It imports what it works with when it runs, so that `--help` is fast.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime
from enum import IntEnum
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, get_type_hints

import typer

from slopewise.models.errors import InputError


class ExitStatus(IntEnum):
    """Exit status of the program."""

    DONE = 0
    FAULT = 1
    BAD_INPUT = 2
    NOT_ADMISSIBLE = 3  # no plan may be driven, a check found something, a result is not usable
    UNDECIDED = 4  # too few stops
    STOPPED = 130


def schema_of(*summaries: str) -> Any:
    """The option `--json-schema` of a command; summaries: MODULE.TYPE of the services' results."""

    def print_schema(is_asked: bool) -> None:
        if is_asked:
            import msgspec

            parts = [summary.rpartition(".") for summary in summaries]
            kinds = [
                getattr(import_module(f"slopewise.services.{m}"), kind) for m, _, kind in parts
            ]
            schemas, definitions = msgspec.json.schema_components(kinds)
            either = schemas[0] if len(schemas) == 1 else {"anyOf": schemas}
            echo(json.dumps({**either, "$defs": definitions}, indent=1))
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

        echo(to_json(summary))
        return
    from rich.console import Console

    console = Console()
    with console.capture() as shown:
        for part in tables:
            console.print(part)
    written = (f"wrote {file}\n" for file in files if file is not None)
    echo(shown.get() + "".join(written), ends_line=False)


def echo(text: str, *, ends_line: bool = True) -> None:
    """Print to standard output, whose reader, such as `head`, may have enough before the end."""
    try:
        typer.echo(text, nl=ends_line)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def with_own_files(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command; InputError for a file to write that it reads, or writes twice.

    Only a model file may replace the model: `calibrate --model m.toml --out m.toml`.
    """

    @wraps(command)
    def run(**values: Any) -> Any:
        from slopewise.services.io.files import real_path

        used: dict[Path, str] = {}
        hints = get_type_hints(command, include_extras=True)
        infos = {name: hints[name].__metadata__[0] for name in values}
        written = {name for name, info in infos.items() if info.writable}
        for name in sorted(values, key=written.__contains__):
            given = values[name] if isinstance(values[name], list) else [values[name]]
            for file in (Path(f) for f in given if isinstance(f, Path) or (name == "model" and f)):
                if file.exists() and not file.is_file():
                    continue  # a folder, a pipe, /dev/null
                earlier = used.setdefault(real_path(file), name)
                is_model = earlier == "model" and infos[name].metavar == "M2.toml"
                if name in written and earlier != name and not is_model:
                    expected = f"expected another file than that of {earlier.removesuffix('_file')}"
                    raise InputError(str(file), f"--{name}", expected)
        return command(**values)

    return run


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
