"""`slopewise coverage`: the stops of a log against the distances that a model allows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from slopewise.services.cli.command import ExitStatus, command, print_result
from slopewise.services.cli.options import (
    AsJson,
    Columns,
    GroundMap,
    LogFiles,
    ModelFile,
    NoDataValue,
    Quantile,
    Topics,
)
from slopewise.services.cli.tables import decimals, notes, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.coverage import CoverageSummary, PartCoverage

_SESSIONS = 20
"""Sessions up to which each has a row; beyond that --json has them."""


@dataclass(frozen=True, slots=True)
class CoverageOptions:
    """Options of `slopewise coverage`."""

    logs: LogFiles
    model: ModelFile
    map_file: GroundMap = None
    nodata: NoDataValue = None
    topics: Topics = None
    columns: Columns = ""
    quantile: Quantile = 0.999
    as_json: AsJson = False


@command("coverage.CoverageSummary")
def coverage(options: CoverageOptions) -> ExitStatus | None:
    """Test whether a model covers the stops of a log.

    The model is not updated: every stop that can be measured is compared with the distance that
    plans at the quantile allow, by speed, grade and session. Status 3: more stops are beyond it
    than chance explains at that quantile.

    [bold]Example[/]  slopewise coverage today.csv --model mine.toml
    """
    from slopewise.services.io.no_data import nodata_of
    from slopewise.services.jobs.coverage import coverage as job

    summary = job(
        options.logs,
        options.model,
        quantile=options.quantile,
        map_file=options.map_file,
        nodata=nodata_of(options.nodata),
        topics=options.topics,
        columns=options.columns,
        quiet=options.as_json,
    )
    print_result(options.as_json, summary, tables(summary, options.model))
    return None if summary.covers else ExitStatus.NOT_ADMISSIBLE


def tables(summary: CoverageSummary, model: str) -> Iterator[Any]:
    """One row per part, and whether the model covers the log."""
    parts: list[tuple[str, PartCoverage]] = [("all", summary)]
    parts += [(_range(part.range, 1.0, "m/s"), part) for part in summary.by_speed]
    parts += [(_range(part.range, 180.0 / math.pi, "°"), part) for part in summary.by_grade]
    if 1 < len(summary.by_session) <= _SESSIONS:
        parts += [(f"session {part.session}", part) for part in summary.by_session]
    yield from table(
        ("", "stops", "beyond", "allowed longer by, mean m", "not allowed at all"),
        (
            (label, p.stops, p.beyond, decimals(p.mean_excess_m, 3), p.not_allowed)
            for label, p in parts
        ),
        title=f"{model} at {summary.quantile:g}",
    )
    covers = "covers" if summary.covers else "does not cover"
    yield f"the model {covers} the {plural(summary.stops, 'measured stop')} of this log"
    yield from notes(summary.notes)


def _range(ends: list[float], scale: float, unit: str) -> str:
    return f"{scale * ends[0]:.1f} … {scale * ends[1]:.1f} {unit}"
