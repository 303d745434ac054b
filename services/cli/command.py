"""A command: options as a dataclass, a function of them, and its result as JSON or as tables.

    @dataclass(frozen=True, slots=True)
    class GreetOptions:
        name: Annotated[str, typer.Argument(help="Of the robot.")]
        as_json: AsJson = False

    @command("greet.GreetSummary")
    def greet(options: GreetOptions) -> ExitStatus | None:
        ...

`slopewise.services.cli.app` lists the commands.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields
from enum import IntEnum
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

T = TypeVar("T")
Command = Callable[..., None]

_JOBS = "slopewise.services.jobs"


class ExitStatus(IntEnum):
    """Exit status of the program."""

    DONE = 0
    FAULT = 1
    BAD_INPUT = 2
    NOT_ADMISSIBLE = 3
    """No plan may be driven, a check found something, or a result is not usable."""
    STOPPED = 130


def command(summary: str = "") -> Callable[[Callable[[T], ExitStatus | None]], Command]:
    """Make a command of a function of one options dataclass; each field is an argument or option.

    Args:
        summary: type that `--json` prints, `MODULE.TYPE` of the jobs; adds `--json-schema`.
    """

    def decorate(function: Callable[[T], ExitStatus | None]) -> Command:
        kind = get_type_hints(function)["options"]
        hints = get_type_hints(kind, include_extras=True)
        parameters = [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                annotation=hints[field.name],
                default=inspect.Parameter.empty if field.default is MISSING else field.default,
            )
            for field in fields(kind)
        ]
        if summary:
            parameters.append(_schema_option(summary))

        def run(**values: Any) -> None:
            if summary:
                del values["json_schema"]
            status = function(kind(**values))
            if status:
                raise typer.Exit(status)

        run.__name__, run.__doc__ = function.__name__, function.__doc__
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        return run

    return decorate


def _schema_option(summary: str) -> inspect.Parameter:
    def print_schema(is_asked: bool) -> None:
        if is_asked:
            import msgspec

            module, _, kind = summary.rpartition(".")
            summary_type = getattr(import_module(f"{_JOBS}.{module}"), kind)
            typer.echo(json.dumps(msgspec.json.schema(summary_type), indent=1))
            raise typer.Exit

    option = typer.Option(
        "--json-schema", is_eager=True, callback=print_schema, help="Print the schema of --json."
    )
    return inspect.Parameter(
        "json_schema",
        inspect.Parameter.KEYWORD_ONLY,
        annotation=Annotated[bool, option],
        default=False,
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
    for file in files:
        if file is not None:
            typer.echo(f"wrote {file}")


def print_ready(as_json: bool, message: str, facts: dict[str, object]) -> None:
    """Print the line of a command that runs until a signal, for the process that waits for it."""
    print(json.dumps({"ready": True, **facts}) if as_json else f"slopewise: {message}", flush=True)
