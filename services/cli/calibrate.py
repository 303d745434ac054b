"""`slopewise calibrate`: the braking model from the stops of drive logs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import ExitStatus, command, print_result
from slopewise.services.cli.options import (
    AsJson,
    Columns,
    Coverage,
    GroundMap,
    LogFiles,
    ModelFile,
    NoDataValue,
    Report,
    Topics,
)
from slopewise.services.cli.tables import line, notes, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    from slopewise.models.calibration.learn import Calibration
    from slopewise.models.calibration.surface_fit import SurfaceFit
    from slopewise.services.jobs.calibrate import CalibrateResult, RejectedLogError

_SUSPECTS = 20
"""Excluded stretches that are listed; --json has all."""


@dataclass(frozen=True, slots=True)
class CalibrateOptions:
    """Options of `slopewise calibrate`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path | None,
        typer.Option(metavar="M2.toml", help="Write the model with what was learned."),
    ] = None
    stops: Annotated[
        Path | None, typer.Option(metavar="stops.csv", help="Write one row per stop.")
    ] = None
    report: Report = None
    sheet: Annotated[
        Path | None,
        typer.Option(
            metavar="sheet.pdf", help="Write the brake sheet, one page to file: .pdf or .html."
        ),
    ] = None
    map_file: GroundMap = None
    nodata: NoDataValue = None
    topics: Topics = None
    columns: Columns = ""
    coverage: Coverage = 0.999
    least_speed: Annotated[  # words: ok, an option
        float | None,
        typer.Option(
            metavar="M/S",
            help="Ignore stops from below this speed. Default: the noise floor of the log.",
        ),
    ] = None
    turn_rate: Annotated[
        float | None,
        typer.Option(
            metavar="RAD/S",
            help="Mean yaw rate from which a stop is a turn and excluded. By default 0.35, or "
            "unlimited where the model has the effect turning_resistance.",
        ),
    ] = None
    stop_settings: Annotated[
        Path | None,
        typer.Option(
            metavar="stops.toml",
            help="Further settings of a stop: longest, settled_speed, ramp, step, full_brake, "
            "fewest and others.",
        ),
    ] = None
    as_json: AsJson = False


@command("calibration_summary.CalibrationSummary")
def calibrate(options: CalibrateOptions) -> ExitStatus | None:
    """Fit the braking model to the stops of drive logs.

    Finds the stops, measures force and dead time of each on the ground under it, fits all of them
    together, and estimates their scatter: margins of force and dead time, and a constant offset
    for the remainder. Suspect stretches are excluded and listed. Named effects of the model stay
    in force. Status 3: the result is written, but not usable, with the reason. --stops has a row
    for every stop that was found, with the reason where it was excluded; it and --report are also
    written where the command rejects the log. --sheet shows on one page, from the fitted model at
    --coverage, stopping distances by speed and grade, the slopes that the brakes hold, and a
    comparison with rules that ignore slopes.

    [bold]Example[/]  slopewise calibrate drive.csv --model atv --out mine.toml --report stops.html
    """
    from slopewise.services.io.model_file import write_model
    from slopewise.services.io.no_data import nodata_of
    from slopewise.services.jobs import calibrate as job
    from slopewise.services.jobs.calibration_summary import summarise, write_stops

    if options.sheet is not None:
        from slopewise.services.report.brake_sheet import check_name

        check_name(options.sheet)
    settings = job.calibration_settings(
        options.coverage,
        stop_settings=options.stop_settings,
        least_speed=options.least_speed,
        turn_rate=options.turn_rate,
    )
    try:
        result = job.calibrate(
            options.logs,
            options.model,
            settings=settings,
            map_file=options.map_file,
            nodata=nodata_of(options.nodata),
            topics=options.topics,
            columns=options.columns,
            quiet=options.as_json,
        )
    except job.RejectedLogError as rejected:
        _write_rejected(rejected, options)
        raise
    if options.out is not None:
        write_model(result.model, options.out)
    sheet = None if options.sheet is None else _write_sheet(result, options)
    if options.stops is not None:
        write_stops(result, options.stops)
    if options.report is not None:
        _write_page(result, options, options.report)
    files = options.out, options.stops, options.report, options.sheet
    print_result(options.as_json, summarise(result, sheet), _tables(result), *files)
    return ExitStatus.NOT_ADMISSIBLE if result.calibration.objections else None


def _provenance(options: CalibrateOptions) -> dict[str, str]:
    return {
        "logs": ", ".join(log.name for log in options.logs),
        "model so far": options.model,
        "map": options.map_file.name if options.map_file else "none",
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }


def _write_page(result: CalibrateResult, options: CalibrateOptions, path: Path) -> None:
    from slopewise.services.report.calibration_page import write_calibration_page

    c = result.calibration
    rows = {label: [cell(s) for s in c.surfaces] for label, cell in ROWS.items()}
    clock = {s.start: float(result.log.columns["t"][s.start]) for s in c.suspects}
    title = f"Brakes of {result.model.name}"
    write_calibration_page(path, c, rows, clock, title=title, provenance=_provenance(options))


def _write_rejected(rejected: RejectedLogError, options: CalibrateOptions) -> None:
    if options.stops is not None:
        from slopewise.services.jobs.calibration_summary import write_rejected_stops

        write_rejected_stops(rejected, options.stops)
    if options.report is not None:
        from slopewise.services.report.calibration_page import RejectedLog, write_rejected_log

        run, t = rejected.log.columns["run"], rejected.log.columns["t"]
        page = RejectedLog(
            str(rejected),
            rejected.windows,
            [f"{run[w.command]}, {t[w.command]:.2f} s" for w in rejected.windows],
            rejected.suspects,
            {s.start: float(t[s.start]) for s in rejected.suspects},
        )
        provenance = _provenance(options)
        del provenance["map"]
        title = "Brakes that were not learned"
        write_rejected_log(options.report, page, title=title, provenance=provenance)


def _write_sheet(result: CalibrateResult, options: CalibrateOptions) -> dict[str, Any]:
    from slopewise.planner.ground.uncertainty import Uncertainty
    from slopewise.services.jobs.calibration_summary import cross_validation
    from slopewise.services.jobs.provenance import calibration_digests
    from slopewise.services.report.brake_numbers import BrakeNumbers
    from slopewise.services.report.brake_sheet import sheet_json, write_sheet

    assert options.sheet is not None
    base = result.calibration.surfaces[0]
    share, spare = cross_validation(base)
    facts = {
        "stops learned from": ROWS["stops learned from"](base),
        "unseen, within": f"{share:.1%}, on average {spare:.3f} m to spare",
    }
    numbers = BrakeNumbers(result.model, Uncertainty(quantile=options.coverage))
    digests = calibration_digests(
        options.logs, options.model, result.model, out=options.out, map_file=options.map_file
    )
    write_sheet(options.sheet, numbers, facts, "\n".join(digests))
    return sheet_json(numbers)


def _tables(result: CalibrateResult) -> Iterator[Any]:
    """Coefficients by surface, the stops, and warnings."""
    c = result.calibration
    yield from table(
        ("", *(surface.name or "base" for surface in c.surfaces)),
        ((label, *map(cell, c.surfaces)) for label, cell in ROWS.items()),
        title=f"braking of {result.model.name}",
    )
    yield _timing(c)
    yield _speed_error(c)
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
    yield from notes(c.warnings)
    for objection in c.objections:
        yield line(f"rejected: {objection}", "red")


def _timing(c: Calibration) -> str:
    import numpy as np

    offset = f"{np.rad2deg(c.mount.offset):+.2f}° by {c.mount.source}"
    return (
        f"dead time {c.dead_time.value:.3f} ± {c.dead_time.std:.3f} s · "
        f"brake dive {np.rad2deg(c.dive.per_deceleration):.2f}° per m/s² · "
        f"mount offset {offset if c.mount.known else 'unknown'}"
    )


def _speed_error(c: Calibration) -> str:
    if c.speed_error is None:
        return "speed error unchanged: the log has too little driving at one command"
    return (
        f"speeds are driven to ± {c.speed_error.value:.3f} m/s, {c.speed_error.bias:+.3f} m/s from "
        f"the command ({plural(c.speed_error.stretches, 'stretch')}, {c.speed_error.seconds:.0f} s)"
    )


def _coefficient(index: int) -> Callable[[SurfaceFit], str]:
    def cell(s: SurfaceFit) -> str:
        std = float(s.fit.covariance[index, index]) ** 0.5
        return f"{s.fit.coefficients[index]:+.4f} ± {std:.4f}"

    return cell


def _scatter(s: SurfaceFit) -> str:
    force = s.margins.force
    return f"{force.relative:.1%} of it" if force.relative > 0.0 else f"{force.absolute:.4f}"


def _weaker(s: SurfaceFit) -> str:
    if s.state is None:
        return "–"
    return f"{s.state.ratio:.0%} ({plural(int(s.state.members.sum()), 'stop')})"


def _grades(s: SurfaceFit) -> str:
    import numpy as np

    low, high = np.rad2deg(s.grade_range)
    return f"{low:.1f}° … {high:.1f}°"


def _cross_validation(s: SurfaceFit) -> tuple[float, float]:
    from slopewise.services.jobs.calibration_summary import cross_validation

    return cross_validation(s)


ROWS: dict[str, Callable[[SurfaceFit], str]] = {
    "m_m, s/m": _coefficient(0),
    "b_m": _coefficient(1),
    "m_b, s/m": _coefficient(2),
    "b_b": _coefficient(3),
    "stops learned from": lambda s: f"{sum(r.kept for r in s.records)} of {len(s.records)}",
    "force scatters by": _scatter,
    "dead time by, s": lambda s: f"{s.margins.dead_time:.4f}",
    "force of a weaker state": _weaker,
    "distance offset, m": lambda s: f"{s.distance_offset:.3f}",
    "time offset, s": lambda s: f"{s.time_offset:.3f}",
    "unseen stops within prediction": lambda s: f"{_cross_validation(s)[0]:.1%}",
    "predictions longer by, mean m": lambda s: f"{_cross_validation(s)[1]:.3f}",
    "speeds, m/s": lambda s: f"{s.speed_range[0]:.2f} … {s.speed_range[1]:.2f}",
    "grades": _grades,
}
"""Rows of the table of surfaces: label and cell."""
