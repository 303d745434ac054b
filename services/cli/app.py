"""The command line: its commands, exit status, and the line of an error.

Exit status: 0 done; 2 bad input, one line on standard error; 3 no admissible candidate, a plan
with violations, a result that is not usable, or a robot with errors; 1 a fault of the program.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from io import TextIOWrapper
from typing import Annotated, Any

import typer
import typer.main

from slopewise.models.errors import SlopewiseError
from slopewise.services.cli import (
    bench,
    calibrate,
    check,
    coverage,
    demo,
    discrepancy,
    doctor,
    export,
    fleet,
    params,
    plan,
    query,
    replay,
    run,
    simulate,
    terrain,
)
from slopewise.services.cli.command import ExitStatus, echo, with_own_files

# Recent versions of typer include a copy of click, so its classes are taken from typer.
_UsageError: Any = typer.BadParameter.__base__
_command_of: Any = cache(typer.main.get_command)  # derived from signatures of all commands

app = typer.Typer(
    name="slopewise",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode="rich",
    help="How fast may the robot go here, so that it can always still stop?\n\n"
    "Plans the fastest speed along each candidate path over an elevation map from which the "
    "vehicle can stop on ground that is known, without tipping.\n\n"
    "[bold]Try[/]  slopewise demo",
)
fleet_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Many paths over large maps, the logs of many vehicles: on several processes or machines.",
)

for _command in (
    plan.plan,
    check.check,
    calibrate.calibrate,
    coverage.coverage,
    terrain.terrain,
    simulate.simulate,
    discrepancy.discrepancy,
    demo.demo,
    run.serve,
    run.ros,
    run.guard,
    doctor.doctor,
    export.export,
    query.query,
    params.params,
    replay.replay,
):
    app.command()(with_own_files(_command))
app.command(context_settings=bench.CONTEXT)(bench.bench)
fleet_app.command("plan")(fleet.fleet_plan)
fleet_app.command("calibrate")(fleet.fleet_calibrate)
fleet_app.command("discrepancy")(fleet.fleet_discrepancy)
app.add_typer(fleet_app, name="fleet")


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        echo(f"slopewise {installed('slopewise')}")
        raise typer.Exit


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a locale such as latin-1 lacks some signs
            stream.reconfigure(errors="replace")
    if os.environ.get("COLUMNS") == "0":
        del os.environ["COLUMNS"]  # tables of no width would have no text
    try:
        status = _command_of(app)(args=arguments, prog_name="slopewise", standalone_mode=False)
    except _UsageError as error:
        if message := error.format_message():  # none where the help was printed instead
            _fail(f"{message} (see slopewise --help)", ExitStatus.BAD_INPUT)
        sys.exit(ExitStatus.BAD_INPUT)
    except SlopewiseError as error:
        _fail(" ".join(str(error).split()), ExitStatus.BAD_INPUT)
    except OSError as error:
        _fail(f"{error.filename or 'file'}: {error.strerror or error}", ExitStatus.BAD_INPUT)
    except typer.Abort:
        _fail("stopped", ExitStatus.STOPPED)
    except Exception as error:
        if os.environ.get("SLOPEWISE_DEBUG"):
            raise
        text = f"fault of slopewise, not of your input: {type(error).__name__}: {error}"
        _fail(f"{text} (SLOPEWISE_DEBUG=1 shows where)", ExitStatus.FAULT)
    sys.exit(status if isinstance(status, int) else ExitStatus.DONE)


def _fail(line: str, status: ExitStatus) -> None:
    sys.stdout.flush()
    print(f"slopewise: {line}", file=sys.stderr)
    sys.exit(status)
