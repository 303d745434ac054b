"""`slopewise calibrate`: braking coefficients, dead time and margins out of drive logs."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from slopewise.models.calibration.learn import Calibration, learn, with_learned
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.find_stops import StopSettings
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.services.cli.arguments.files import CalibrateOptions
from slopewise.services.cli.commands.calibration_refused import leave
from slopewise.services.cli.commands.calibration_rows import ROWS, speed_words, surface_json
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.logs.log_source import grade_by_map, names_of, refuse_wrong_units
from slopewise.services.io.logs.speed_unit import refuse_too_fast, refuse_unit
from slopewise.services.io.logs.unseen_channels import unseen_channels
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.io.no_data import nodata_of
from slopewise.services.io.table import write_csv
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_sheet import sheet_json
from slopewise.services.report.plan_labels import plural

_LISTED = 20


@dataclass(frozen=True, slots=True)
class CalibrateResult:
    """What was learned, the model with it, and the log it was learned from; the brake sheet."""

    calibration: Calibration
    model: Model
    log: DriveLog
    seconds: float
    sheet: BrakeNumbers | None = None


def run(job: CalibrateOptions, *, quiet: bool = False) -> CalibrateResult:
    """Read, find, fit.

    Raises:
        InputError: names file and field, or says why there are too few stops.
    """
    begin = time.perf_counter()
    settings = _settings(job)
    model = read_model(find_model(job.model))
    with progress_bar("calibrating", 4, quiet=quiet) as advance:
        log = read_logs(job.logs, job.topics, job.columns)
        advance(1)
        try:
            learned, better = _learned(job, model, log, settings, advance)
        except (InputError, ParameterError) as error:
            if isinstance(error, ParameterError):
                words = f"expected {error.expected}"
                error = fault(names_of(job.logs), error.field, words)
            leave(log, settings.stops, job, error)
            raise error from None
        advance(1)
    return CalibrateResult(learned, better, log, time.perf_counter() - begin)


def _learned(
    job: CalibrateOptions,
    model: Model,
    log: DriveLog,
    settings: CalibrationSettings,
    advance: Callable[[int], None],
) -> tuple[Calibration, Model]:
    refuse_wrong_units(log)
    refuse_too_fast(log, model)
    ground = grade_by_map(log, job.map_file, model.vehicle, nodata_of(job.nodata))
    advance(1)
    learned = learn(
        log.columns, log.runs, model.braking, ground=ground, settings=settings, beside=model
    )
    advance(1)
    grades = np.array([r.grade for s in learned.surfaces for r in s.records])
    refuse_unit(learned.braking, model.braking, grades, names_of(job.logs))
    unseen = unseen_channels(model.effect, log.columns)
    learned = dataclasses.replace(learned, warnings=(*learned.warnings, *unseen))
    return learned, with_learned(model, learned)


def _settings(job: CalibrateOptions) -> CalibrationSettings:
    try:
        stops = StopSettings(
            partial=True,
            least_speed=job.least_speed,
            longest=job.longest,
            settled_speed=job.settled_speed,
            turn_rate=job.turn_rate,
            ramp=job.ramp,
            step=job.step,
            full_brake=job.full_brake,
            fewest=job.fewest,
        )
        return CalibrationSettings(coverage=job.coverage, stops=stops)
    except ParameterError as error:
        option = f"--{error.field.replace('_', '-')}"
        raise fault(option, "", f"expected {error.expected}") from None


def write_learned_model(result: CalibrateResult, path: Path) -> None:
    """The model file with what was learned, all or nothing."""
    write_model(result.model, path)


def write_stops(result: CalibrateResult, path: Path) -> None:
    """A row a stop, found or learned from, SI units; empty where a stop was not measured."""
    learned = _by_command(result.calibration)
    offsets = {s.name: s.time_offset for s in result.calibration.surfaces}
    rows: dict[str, list[Any]] = {}
    for window in result.calibration.windows:
        record = learned.get(window.command)
        row: dict[str, Any] = {
            "run": str(result.log.columns["run"][window.command]),
            "t": float(result.log.columns["t"][window.command]),
            "verdict": window.verdict.name.lower() if record or not window.usable else "unused",
            "reason": window.reason,
            "speed": window.held_speed,
        }
        row |= _measured(record, offsets) if record else dict.fromkeys(_MEASURED, np.nan)
        for name, value in row.items():
            rows.setdefault(name, []).append(value)
    columns = {
        name: values if name in ("run", "verdict", "reason") else np.array(values, np.float64)
        for name, values in rows.items()
    }
    write_csv(columns, path)


def write_page(result: CalibrateResult, job: CalibrateOptions, path: Path) -> None:
    """The report page."""
    from slopewise.services.report.calibration_page import write_calibration_page

    c = result.calibration
    rows = {label: [cell(s) for s in c.surfaces] for label, cell in ROWS.items()}
    clock = {s.start: float(result.log.columns["t"][s.start]) for s in c.suspects}
    provenance = {
        "logs": ", ".join(log.name for log in job.logs),
        "model so far": job.model,
        "map": job.map_file.name if job.map_file else "none",
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    title = f"Brakes of {result.model.name}"
    write_calibration_page(path, c, rows, clock, title=title, provenance=provenance)


_MEASURED = (
    "onset_speed",
    "onset_time",
    "grade",
    "force_ratio",
    "force_std",
    "distance",
    "time",
    "predicted_distance",
    "predicted_with_offset",
    "predicted_time",
    "predicted_time_with_offset",
    "kept",
)


def _measured(r: StopRecord, offsets: dict[str, float]) -> dict[str, float]:
    time_offset = offsets.get(r.samples.terrain, offsets[""])
    values = (
        r.onset_speed,
        r.knee.onset_time,
        r.grade,
        r.force_ratio,
        r.force_std,
        r.samples.distance,
        r.samples.standstill_time,
        r.predicted_distance,
        r.bound_distance,
        r.predicted_time,
        r.predicted_time + time_offset,
        float(r.kept),
    )
    return dict(zip(_MEASURED, values, strict=True))


def _by_command(calibration: Calibration) -> dict[int, StopRecord]:
    return {r.samples.window.command: r for s in calibration.surfaces for r in s.records}


def as_json(result: CalibrateResult) -> dict[str, Any]:
    """Everything for machines, SI units and radians."""
    c = result.calibration
    return {
        "stops": {"found": len(c.windows), **c.verdicts},
        "dead_time": {
            "value": c.dead_time.value,
            "std": c.dead_time.std,
            "jitter": c.dead_time.between_stops,
        },
        "dive": {
            "value": c.dive.per_deceleration,
            "std": c.dive.std,
            "settling": c.dive.settling,
        },
        "mount": {"value": c.mount.offset, "std": c.mount.std, "source": c.mount.source},
        "speed_error": None if c.speed_error is None else asdict(c.speed_error),
        "surfaces": [surface_json(s) for s in c.surfaces],
        "suspects": [
            {
                "start": float(result.log.columns["t"][s.start]),
                "end": float(result.log.columns["t"][s.stop - 1]),
                "channel": s.channel,
                "kind": s.kind.value,
                "reason": s.reason,
            }
            for s in c.suspects
        ],
        "levels": None if c.levels is None else asdict(c.levels),
        "warnings": list(c.warnings),
        "objections": list(c.objections),
        "seconds": result.seconds,
        **({} if result.sheet is None else {"sheet": sheet_json(result.sheet)}),
    }


def show(result: CalibrateResult, console: Console) -> None:
    """Coefficients of each surface, what the stops were, what to know before trusting it."""
    c = result.calibration
    table = Table(title=f"braking of {result.model.name}", box=box.SIMPLE_HEAD)
    table.add_column("")
    for surface in c.surfaces:
        table.add_column(surface.name or "base", justify="right")
    for label, cell in ROWS.items():
        table.add_row(label, *map(cell, c.surfaces))
    console.print(table)
    dead = f"dead time {c.dead_time.value:.3f} ± {c.dead_time.std:.3f} s"
    dive = f"brake dive {np.rad2deg(c.dive.per_deceleration):.2f}° per m/s²"
    known = (
        f"{np.rad2deg(c.mount.offset):+.2f}° by {c.mount.source}" if c.mount.known else "unknown"
    )
    console.print(f"{dead} · {dive} · mount offset {known}")
    console.print(speed_words(c.speed_error))
    if c.levels is not None:
        console.print(
            f"brakes act from {c.levels.dead_band:.0%} of their application on and are at their "
            f"full force from {c.levels.saturation:.0%} "
            f"({plural(c.levels.stops, 'stop')} in between)"
        )
    kinds = ", ".join(f"{n} {name}" for name, n in c.verdicts.items())
    console.print(f"stops found: {len(c.windows)} – {kinds}")
    for suspect in c.suspects[:_LISTED]:
        at = result.log.columns["t"][suspect.start]
        console.print(f"left out at t = {at:.2f} s: {suspect.reason}", style="yellow")
    if len(c.suspects) > _LISTED:
        console.print(f"… and {len(c.suspects) - _LISTED} more stretches", style="yellow")
    for warning in c.warnings:
        console.print(f"note: {warning}", style="yellow")
    for objection in c.objections:
        console.print(f"of no use: {objection}", style="red")
