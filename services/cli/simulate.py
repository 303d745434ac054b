"""`slopewise simulate`: the stops of a drive log, replayed through a model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import print_result, schema_of
from slopewise.services.cli.options import output
from slopewise.services.cli.tables import notes, table

if TYPE_CHECKING:
    from slopewise.services.jobs.simulate import SimulateSummary


def simulate(
    logs: options.LogFiles,
    model: options.ModelFile,
    out: Annotated[
        Path | None, output("Write run,t,v_measured,v_simulated,residual.", "sim.csv")
    ] = None,
    topics: options.Topics = None,
    columns: options.Columns = "",
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.simulate.SimulateSummary")] = False,
) -> None:
    """Replay the stops of a drive log through the model.

    From each stop command on, the model drives: dead time at held speed, then braking along the
    logged grade. Before it the simulation follows the measurement.

    [bold]Example[/]  slopewise simulate drive.csv --model atv --out sim.csv
    """
    from slopewise.services.io.files import check_ending
    from slopewise.services.jobs.log_input import LogInput
    from slopewise.services.jobs.simulate import simulate as job

    check_ending(out, ".csv")
    result = job(LogInput(logs, topics=topics, columns=columns), model)
    if out is not None:
        result.write(out)
    print_result(as_json, result.summary, tables(result.summary), out)


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
