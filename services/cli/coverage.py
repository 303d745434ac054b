"""`slopewise coverage`: the stops of a log against the distances that a model allows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result, schema_of
from slopewise.services.cli.tables import notes, number, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.coverage import CoverageSummary, PartCoverage

_SESSIONS = 20  # number of sessions up to which each has a row; --json has them always


def coverage(
    logs: options.LogFiles,
    model: options.ModelFile,
    map_file: options.GroundMap = None,
    nodata: options.NoDataValue = None,
    topics: options.Topics = None,
    columns: options.Columns = "",
    quantile: options.Quantile = 0.999,
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.coverage.CoverageSummary")] = False,
) -> ExitStatus | None:
    """Test whether a model covers the stops of a log.

    The model is not updated: every stop that can be measured is compared with the distance that
    plans at the quantile allow, by speed, grade and session. A stop from a speed that plans do not
    allow at all is not covered. Status 3: more stops are beyond than chance explains at that
    quantile. Status 4: undecided, too few stops.

    [bold]Example[/]  slopewise coverage today.csv --model mine.toml
    """
    from slopewise.services.jobs.coverage import coverage as job
    from slopewise.services.jobs.log_input import LogInput

    log_input = LogInput(logs, map_file, nodata, topics, columns)
    summary = job(log_input, model, quantile=quantile)
    print_result(as_json, summary, _tables(summary))
    if not summary.covers:
        return ExitStatus.NOT_ADMISSIBLE
    return None if summary.decided else ExitStatus.UNDECIDED


def _tables(summary: CoverageSummary) -> Iterator[Any]:
    """One row per part, and whether the model covers the log."""
    parts: list[tuple[str, PartCoverage]] = [("all", summary)]
    parts += [(_range(part.range, 1.0, "m/s"), part) for part in summary.by_speed]
    parts += [(_range(part.range, 180.0 / math.pi, "°"), part) for part in summary.by_grade]
    if 1 < len(summary.by_session) <= _SESSIONS:
        parts += [(f"session {part.session}", part) for part in summary.by_session]
    yield from table(
        ("", "stops", "beyond", "95 % interval", "longer by, m", "not allowed"),
        (
            (
                label,
                p.stops,
                p.beyond,
                f"{p.interval[0]:.1%} … {p.interval[1]:.1%}",
                number(p.mean_excess_m, ".3f"),
                p.not_allowed,
            )
            for label, p in parts
        ),
        title=f"{summary.model} at {summary.quantile:g}",
    )
    stops = plural(summary.stops, "measured stop")
    if not summary.covers:
        yield f"the model does not cover the {stops} of this log"
    elif summary.decided:
        yield f"the model covers the {stops} of this log"
    else:
        yield f"undecided: {stops}, at least {summary.needed} are needed"
    yield from notes(summary.notes)


def _range(ends: list[float], scale: float, unit: str) -> str:
    return f"{scale * ends[0]:.1f} … {scale * ends[1]:.1f} {unit}"
