"""`slopewise simulate`: the stops of a drive log, replayed through a model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import AsJson, Columns, LogFiles, ModelFile, Topics
from slopewise.services.cli.tables import notes, table

if TYPE_CHECKING:
    from slopewise.services.jobs.simulate import SimulateSummary


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """Options of `slopewise simulate`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path | None,
        typer.Option(metavar="sim.csv", help="Write run,t,v_measured,v_simulated,residual."),
    ] = None
    topics: Topics = None
    columns: Columns = ""
    as_json: AsJson = False


@command("simulate.SimulateSummary")
def simulate(options: SimulateOptions) -> None:
    """Replay the stops of a drive log through the model.

    From each stop command on, the model drives: dead time at held speed, then braking along the
    logged grade. Before it the simulation follows the measurement.

    [bold]Example[/]  slopewise simulate drive.csv --model atv --out sim.csv
    """
    from slopewise.services.jobs.simulate import simulate as job

    result = job(
        options.logs,
        options.model,
        topics=options.topics,
        columns=options.columns,
        quiet=options.as_json,
    )
    if options.out is not None:
        result.write(options.out)
    print_result(options.as_json, result.summary, tables(result.summary), options.out)


def tables(summary: SimulateSummary) -> Iterator[Any]:
    """One row per run."""
    yield from table(
        ("run", "stops", "rms [m/s]", "worst [m/s]", "simulation longer by [m]"),
        (
            (r.run, r.stops, f"{r.rms:.3f}", f"{r.worst:.3f}", f"{r.longer_by:+.3f}")
            for r in summary.runs
        ),
        title="measured against simulated speed",
        more="more runs",
    )
    yield from notes(summary.notes)
