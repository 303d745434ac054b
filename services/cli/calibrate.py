"""`slopewise calibrate`: the braking model from the stops of drive logs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result, provenance_of, schema_of
from slopewise.services.cli.options import option, output
from slopewise.services.cli.tables import line, notes, rejections, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.calibrate import CalibrateResult

_SUSPECTS = 20  # excluded stretches that are listed; --json has all


def calibrate(
    logs: options.LogFiles,
    model: options.ModelFile,
    out: Annotated[Path | None, output("Write the model with what was learned.", "M2.toml")] = None,
    stops: Annotated[Path | None, output("Write one row per stop.", "stops.csv")] = None,
    report: options.Report = None,
    sheet: Annotated[
        Path | None, output("Write the brake sheet, one page to file: .pdf or .html.", "sheet.pdf")
    ] = None,
    map_file: options.GroundMap = None,
    nodata: options.NoDataValue = None,
    topics: options.Topics = None,
    columns: options.Columns = "",
    coverage: options.Coverage = 0.999,
    stop_settings: Annotated[
        Path | None,
        option(
            "Settings of a stop: least_speed, turn_rate, longest, settled_speed, ramp, step, "
            "full_brake, fewest and others.",
            "stops.toml",
        ),
    ] = None,
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.calibration_summary.CalibrationSummary")] = False,
) -> ExitStatus | None:
    """Fit the braking model to the stops of drive logs.

    Finds the stops, measures force and dead time of each on the ground under it, fits all of them
    together, and learns how much longer stops are than predicted: one distribution over speed,
    grade, brake level and session, from which plans at any quantile take their distance. Says
    which share n stops of m sessions support; name sessions (days) in a column session. Suspect
    stretches are excluded and listed. Named effects of the model stay in force. Status 3: the
    result is written, but physically implausible and not to be planned with; the model file
    begins with the reason. --stops has a row for every stop that was found, with the reason where
    it was excluded; it and --report are also written where the command rejects the log. --sheet
    shows on one page, from the fitted model at
    --coverage, stopping distances by speed and grade, the slopes that the brakes hold, and a
    comparison with rules that ignore slopes.

    [bold]Example[/]  slopewise calibrate drive.csv --model atv --out mine.toml --report stops.html
    """
    from slopewise.services.io.files import check_ending
    from slopewise.services.io.model_file import write_model
    from slopewise.services.jobs import calibrate as job
    from slopewise.services.jobs import calibration_summary as summaries
    from slopewise.services.jobs.log_input import LogInput
    from slopewise.services.report import calibration_page

    check_ending(out, ".toml")
    if sheet is not None:
        from slopewise.services.report import brake_sheet

        brake_sheet.check_name(sheet)
    settings = job.calibration_settings(coverage, stop_settings)
    log_input = LogInput(logs, map_file, nodata, topics, columns)
    try:
        result = job.calibrate(log_input, model, settings=settings)
    except job.RejectedLogError as rejected:
        if stops is not None:
            summaries.write_rejected_stops(rejected, stops)
        if report is not None:
            facts = provenance_of(logs, model)
            calibration_page.write_rejected_log(report, rejected, facts)
        raise
    numbers = None
    if out is not None:
        write_model(result.model, out, result.calibration.objections)
    if sheet is not None:
        numbers = brake_sheet.write_calibration_sheet(
            sheet, result, log_input, model, out, quantile=coverage
        )
    if stops is not None:
        summaries.write_stops(result, stops)
    if report is not None:
        facts = provenance_of(logs, model, map=map_file.name if map_file else "none")
        calibration_page.write_calibration_page(report, result, facts)
    summary = summaries.summarise(result, numbers)
    print_result(as_json, summary, _tables(result), out, stops, report, sheet)
    return ExitStatus.NOT_ADMISSIBLE if result.calibration.objections else None


def _tables(result: CalibrateResult) -> Iterator[Any]:
    """Coefficients by surface, the stops, and warnings."""
    from slopewise.services.jobs.calibration_summary import surface_rows

    c = result.calibration
    yield from table(
        ("", *(surface.name or "base" for surface in c.surfaces)),
        ((label, *cells) for label, cells in surface_rows(c).items()),
        title=f"braking of {result.model.name}",
    )
    offset = f"{math.degrees(c.mount.offset):+.2f}° by {c.mount.source}"
    yield (
        f"dead time {c.dead_time.value:.3f} ± {c.dead_time.std:.3f} s · "
        f"brake dive {math.degrees(c.dive.per_deceleration):.2f}° per m/s² · "
        f"mount offset {offset if c.mount.known else 'unknown'}"
    )
    if (error := c.speed_error) is None:
        yield "speed error unchanged: the log has too little driving at one command"
    else:
        yield (
            f"speeds are driven to ± {error.value:.3f} m/s, {error.bias:+.3f} m/s from "
            f"the command ({plural(error.stretches, 'stretch')}, {error.seconds:.0f} s)"
        )
    if c.levels is not None:
        yield (
            f"brakes act from {c.levels.dead_band:.0%} of their application on and are at their "
            f"full force from {c.levels.saturation:.0%} "
            f"({plural(c.levels.stops, 'stop')} in between)"
        )
    kinds = ", ".join(f"{n} {name}" for name, n in c.verdicts.items())
    yield f"stops found: {len(c.windows)} – {kinds}"
    for suspect in c.suspects[:_SUSPECTS]:
        t = result.log.columns["t"][suspect.start]
        yield line(f"excluded at t = {t:.2f} s: {suspect.reason}", "yellow")
    if len(c.suspects) > _SUSPECTS:
        yield line(f"… and {len(c.suspects) - _SUSPECTS} more stretches", "yellow")
    for surface in c.surfaces:
        yield f"{surface.name + ': ' if surface.name else ''}{surface.promise.sentence()}"
    yield from notes(c.warnings)
    if c.objections:
        yield from rejections(c.objections)
