"""`slopewise check`: an independent check of plans of any planner."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result, schema_of
from slopewise.services.cli.options import argument, option
from slopewise.services.cli.tables import LISTED, line, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.check import CheckResult


def check(
    plan_file: Annotated[
        Path,
        argument(
            "Plans: CSV or Parquet with x,y,speed and any further column of a plan file.", "PLAN"
        ),
    ],
    map_file: Annotated[Path, option("Elevation map: GeoTIFF, .npz, or a bag.", "MAP", "--map")],
    model: options.ModelFile,
    clear: options.ClearDistance = math.inf,
    quantile: options.Quantile = 0.999,
    topics: options.Topics = None,
    nodata: options.NoDataValue = None,
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.check.CheckSummary")] = False,
) -> ExitStatus | None:
    """Check plans of any planner: violations by station, kind and size.

    Ground, forces and an emergency stop from every row, and from between rows, are derived from
    map and model independently of the planner. Shared with it are the readers, the formulas of
    named effects and gravity. Every column is compared with what follows from them, or named as
    not verified. Status 3: a plan is refused, since it breaks a rule, says what is not so, is
    infeasible, or has rows too far apart to judge.

    [bold]Example[/]  slopewise check plan.csv --map hill.tif --model atv --clear 20
    """
    from slopewise.services.jobs.check import check as job

    result = job(
        plan_file, map_file, model, clear=clear, quantile=quantile, topics=topics, nodata=nodata
    )
    print_result(as_json, result.summary, _tables(result))
    return None if result.valid else ExitStatus.NOT_ADMISSIBLE


def _tables(result: CheckResult) -> Iterator[Any]:
    """Verdict on every plan, and the largest violation of each kind of those that are refused."""
    invalid = [report for report in result.reports if not report.valid]
    stops = sum(report.stops for report in result.reports)
    yield line(
        f"{plural(len(result.reports), 'plan')} with model {result.model}, "
        f"{plural(stops, 'emergency stop')}: "
        + (f"{len(invalid)} with violations" if invalid else "no violation"),
        "red" if invalid else "green",
    )
    if len(result.reports) > 1:
        verdicts = [
            (r.candidate, r.status, "passes" if r.valid else "refused", r.refused_for or "")
            for r in result.reports[:LISTED]
        ]
        columns = ("candidate", "status", "verdict", "why")
        yield from table(columns, verdicts, left=("status", "verdict", "why"))
    rows = []
    for report in invalid[:LISTED]:
        kinds = [violation.kind for violation in report.violations]
        for kind, v in sorted(report.worst().items(), key=lambda item: item[1].row):
            where, size = f"{v.station:.2f}", f"{v.size:.3g} {v.unit}"
            rows.append((report.candidate, kind, kinds.count(kind), where, size, v.sentence))
    if rows:
        headings = ("candidate", "kind", "rows", "worst at\nm", "by", "what")
        yield from table(headings, rows, left=("kind", "what"))
    if len(invalid) > LISTED:
        yield f"… and {len(invalid) - LISTED} more plans; --json gives all"
    unverified = {name for report in result.reports for name in report.unverified}
    if unverified:
        yield line(f"columns that were not verified: {', '.join(sorted(unverified))}", "dim")
    of_plans = [note for report in result.reports for note in report.notes]
    for note in dict.fromkeys([*result.notes, *of_plans]):
        yield line(f"note: {note}", "dim")
