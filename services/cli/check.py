"""`slopewise check`: an independent check of plans of any planner."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import ExitStatus, command, print_result
from slopewise.services.cli.options import (
    AsJson,
    ClearDistance,
    ModelFile,
    NoDataValue,
    Quantile,
    Topics,
    clear_of,
)
from slopewise.services.cli.tables import LISTED, line, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.check import CheckResult


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Options of `slopewise check`."""

    plan_file: Annotated[
        Path,
        typer.Argument(
            metavar="PLAN",
            help="Plans: CSV or Parquet with x,y,speed and any further column of a plan file.",
        ),
    ]
    map_file: Annotated[
        Path, typer.Option("--map", metavar="MAP", help="Elevation map: GeoTIFF, .npz, or a bag.")
    ]
    model: ModelFile
    clear: ClearDistance = None
    quantile: Quantile = 0.999
    topics: Topics = None
    nodata: NoDataValue = None
    as_json: AsJson = False


@command("check.CheckSummary")
def check(options: CheckOptions) -> ExitStatus | None:
    """Check plans of any planner: violations by station, kind and size.

    Ground, forces and an emergency stop from every row, and from between rows, are derived from
    map and model independently of the planner. Shared with it are the readers, the formulas of
    named effects and gravity. Status 3: there is a violation.

    [bold]Example[/]  slopewise check plan.csv --map hill.tif --model atv --clear 20
    """
    from slopewise.services.io.no_data import nodata_of
    from slopewise.services.jobs.check import check as job

    result = job(
        options.plan_file,
        options.map_file,
        options.model,
        clear=clear_of(options.clear),
        quantile=options.quantile,
        topics=options.topics,
        nodata=nodata_of(options.nodata),
        quiet=options.as_json,
    )
    print_result(options.as_json, result.summary, tables(result))
    return None if result.valid else ExitStatus.NOT_ADMISSIBLE


def tables(result: CheckResult) -> Iterator[Any]:
    """The largest violation of each kind, by plan."""
    invalid = [report for report in result.reports if not report.valid]
    stops = sum(report.stops for report in result.reports)
    yield line(
        f"{plural(len(result.reports), 'plan')} with model {result.model}, "
        f"{plural(stops, 'emergency stop')}: "
        + (f"{len(invalid)} with violations" if invalid else "no violation"),
        "red" if invalid else "green",
    )
    rows = []
    for report in invalid[:LISTED]:
        kinds = [violation.kind for violation in report.violations]
        for kind, v in sorted(report.worst().items(), key=lambda item: item[1].row):
            size = f"{v.size:.3g} {v.unit}"
            station = f"{v.station:.2f}"
            rows.append((report.candidate, kind, kinds.count(kind), station, size, v.sentence))
    if rows:
        columns = ("candidate", "kind", "rows", "worst at\nm", "by", "what")
        yield from table(columns, rows, left=("kind", "what"), limit=len(rows))
    if len(invalid) > LISTED:
        yield f"… and {len(invalid) - LISTED} more plans; --json gives all"
    of_plans = [note for report in result.reports for note in report.notes]
    for note in dict.fromkeys([*result.notes, *of_plans]):
        yield line(f"note: {note}", "dim")
