"""The command that measures: `bench` forwards to the benchmarks, which know their options."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(rich_markup_mode="rich")


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def bench(
    context: typer.Context,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all figures as JSON.")
    ] = None,
) -> None:
    """Benchmark the planner, its cycle, optimality, closed-loop, discrepancy, fleet or obstacles.

    Times depend on the machine, so ratios are the result. All options: `python -m benchmarks -h`.
    """
    installed = find_spec("slopewise.benchmarks") is not None
    module = import_module(f"{'slopewise.' if installed else ''}benchmarks.__main__")
    module.main([*context.args, *(("--json", str(json_file)) if json_file else ())])
