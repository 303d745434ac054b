"""`slopewise bench`: forwards to the benchmarks, which have their own options."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Annotated, Any

import typer

from slopewise.models.errors import InputError

CONTEXT: dict[str, Any] = {
    "allow_extra_args": True,
    "ignore_unknown_options": True,
    "help_option_names": [],
}
"""Every option, `--help` too, is that of the benchmarks."""

_EXTRA = ("commonroad", "mujoco", "numba", "toppra", "trajectory_planning_helpers")
"""What the extras `bench` and `sim` bring."""


def bench(
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME] [--json FILE] …", help="See slopewise bench --help."),
    ] = None,
) -> None:
    """Benchmark the planner against its peers, or one of cycle, optimality, closed-loop, …

    Times depend on the machine, so ratios are the result.
    """
    try:
        benchmarks().main(arguments or [])
    except ModuleNotFoundError as missing:
        if missing.name not in _EXTRA:
            raise
        expected = f"needs {missing.name}: pip install '.[bench,sim]' in a clone"
        raise InputError("bench", "", expected) from None


def benchmarks() -> Any:
    """The program of the benchmarks: in `slopewise` when installed, else in the repository."""
    installed = find_spec("slopewise.benchmarks") is not None
    return import_module(f"{'slopewise.' if installed else ''}benchmarks.__main__")
