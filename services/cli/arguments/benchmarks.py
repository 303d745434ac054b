"""The command that measures: bench."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

app = typer.Typer(rich_markup_mode="rich")


@app.command()
def bench(
    what: Annotated[
        Literal[
            "planner", "cycle", "optimality", "closed-loop", "discrepancy", "fleet", "obstacles"
        ],
        typer.Argument(help="What to measure, see above."),
    ] = "planner",
    quick: Annotated[bool, typer.Option(help="Fewer repetitions, half a minute.")] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all figures as JSON.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="out.html", help="Write the growth plots as a page.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="closed-loop: write report and pictures, and keep every drive: a run that was "
            "interrupted goes on. discrepancy: likewise, a line of JSON a set. fleet: a folder "
            "with room for the map.",
        ),
    ] = None,
    sets: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="discrepancy: sets at most.")
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(metavar="M", min=0.0, help="discrepancy: begin no further set after that."),
    ] = None,
) -> None:
    r"""Benchmark the planner beside its peers, in one run on one thread.

    [bold]cycle[/] times 10,000 cycles of the moving horizon on one core, alone and beside others,
    and watches memory over an hour of simulated driving. [bold]optimality[/] holds smoothed plans
    against IPOPT on 500 generated problems.

    [bold]closed-loop[/] learns a braking model from stops in a physics engine, then lets planner
    and plainer policies drive there, with walls and unknown ground at random, on two processes; the
    extra `sim` brings the engine.

    [bold]discrepancy[/] hides effects in stops of a plant of its own, of a physics engine, and of a
    multi-body car, has each log investigated by a process that sees nothing else, and compares what
    was said with what is true, on two processes. It takes some two hours, quickly some minutes.

    [bold]obstacles[/] plans over 2,400 obstacles around the limits of two vehicles, compares what
    is barred with their true sizes, and drives 200 of them in a physics engine, if it is there.

    Times depend on the machine, so ratios are the result. Peers that are not installed are said to
    be missing; pip install '.\[bench]' in a clone brings them.
    """
    from slopewise.services.cli.commands import bench as command

    if what == "closed-loop":
        command.closed_loop(quick=quick, json_file=json_file, out=out)
    elif what == "fleet":
        command.fleet(quick=quick, json_file=json_file, out=out)
    elif what == "discrepancy":
        command.discrepancy(
            quick=quick, json_file=json_file, plot=plot, out=out, sets=sets, minutes=minutes
        )
    elif what == "planner":
        command.run(quick=quick, json_file=json_file, plot=plot)
    else:
        command.horizon(what, quick=quick, json_file=json_file)
