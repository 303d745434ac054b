"""The command line. Commands read their words in `slopewise.services.cli.arguments`, and do their
work in `slopewise.services.cli.commands`.

Exit status: 0 done; 2 bad input, one line on standard error; 3 no admissible candidate, a plan
that breaks a rule, or a robot that does not fit; 1 a fault of the program.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated, Any

import typer

from slopewise.models.errors import SlopewiseError
from slopewise.services.cli.arguments import benchmarks, files, fleet, robot

BAD_INPUT = 2
FAULT = 1

# Recent versions of typer bring a click of their own, so its classes are taken from typer.
_UsageError: Any = typer.BadParameter.__base__

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
app.add_typer(files.app)
app.add_typer(benchmarks.app)
app.add_typer(robot.app)
app.add_typer(fleet.app, name="fleet")


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"slopewise {installed('slopewise')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    try:
        status = app(args=arguments, prog_name="slopewise", standalone_mode=False)
    except _UsageError as error:
        _fail(f"{error.format_message()} (see slopewise --help)", BAD_INPUT)
    except SlopewiseError as error:
        _fail(" ".join(str(error).split()), BAD_INPUT)
    except OSError as error:
        _fail(f"{error.filename or 'file'}: {error.strerror or error}", BAD_INPUT)
    except typer.Abort:
        _fail("stopped", 130)
    except Exception as error:
        if os.environ.get("SLOPEWISE_DEBUG"):
            raise
        text = f"fault of slopewise, not of your input: {type(error).__name__}: {error}"
        _fail(f"{text} (SLOPEWISE_DEBUG=1 shows where)", FAULT)
    sys.exit(status if isinstance(status, int) else 0)


def _fail(line: str, status: int) -> None:
    sys.stdout.flush()
    print(f"slopewise: {line}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
