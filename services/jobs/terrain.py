"""Estimate resistances, slip track, description and changes of terrain from drive logs."""

from __future__ import annotations

import time

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import find_suspects, usable
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import TerrainMonitor
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.terrain.trace import TerrainTrace, trace
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.terrain_file import (
    TerrainFile,
    find_terrains,
    read_terrains,
    shipped_terrains,
)
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult
from slopewise.services.jobs.terrain_run import CHANNELS, NEEDED, monitor_rows, run_events


def terrain(
    logs: LogInput,
    model_file: str,
    *,
    terrains: str | None = None,
    quiet: bool = True,
) -> TerrainResult:
    """Read, estimate, describe.

    `terrains`: terrain file or shipped name, by default that of the model's name.

    Raises:
        InputError: names file and field.
    """
    model_path = find_model(model_file)
    model = read_model(model_path)
    _check_vehicle(model, str(model_path))
    known = _read_terrains(terrains, model)
    log = logs.read()
    _check_channels(log)
    begin = time.perf_counter()
    monitor = _monitor(model, known)
    suspects = [*find_suspects(log.columns, log.runs)]
    suspects += implausible(log.columns, log.runs, model.vehicle)
    usable_samples = usable(len(log.columns["t"]), suspects, CHANNELS)
    runs = []
    with progress_bar("driving", len(log.runs), quiet=quiet) as advance:
        for part in log.runs:
            runs.append(run_events(log, part, usable_samples, suspects, monitor))
            advance(1)
    return TerrainResult(
        runs=runs,
        log=log,
        model=model,
        terrains=known,
        usable_samples=usable_samples,
        seconds=time.perf_counter() - begin,
        notes=tuple(_notes(log, known, monitor, str(model_path))),
    )


def trace_run(result: TerrainResult, run: RunEvents) -> TerrainTrace:
    """Estimates of the filter along a run."""
    monitor = _monitor(result.model, result.terrains)
    rows = monitor_rows(result.log, run.samples, result.usable_samples)
    return trace(monitor.estimator, rows, result.terrains.filter)


def _monitor(model: Model, terrains: TerrainFile) -> TerrainMonitor:
    return TerrainMonitor(model, terrains.classes, terrains.thresholds, terrains.estimator)


def _check_vehicle(model: Model, source: str) -> None:
    if model.vehicle.drive != "skid_steer":
        raise fault(source, "vehicle.drive", "expected skid_steer, got ackermann")
    try:
        Drivetrain.of(model.vehicle)
    except ParameterError as error:
        raise fault(source, error.field, f"expected {error.expected}") from None


def _read_terrains(name: str | None, model: Model) -> TerrainFile:
    if name is not None:
        return read_terrains(find_terrains(name))
    shipped = shipped_terrains().get(model.name)
    return TerrainFile(name=model.name) if shipped is None else read_terrains(shipped)


def _check_channels(log: DriveLog) -> None:
    for part, source in zip(log.runs, log.sources, strict=True):
        for name in NEEDED:
            if name not in log.columns or np.isnan(log.columns[name][part]).all():
                missing = f"missing column, expected {', '.join(NEEDED)} and run,t,v,v_cmd,pitch"
                raise fault(source, f"column {name}", missing)


def _notes(
    log: DriveLog, terrains: TerrainFile, monitor: TerrainMonitor, model_path: str
) -> list[str]:
    notes = []
    if message := monitor.vehicle_check.message():
        notes.append(f"{model_path}: {message}")
    if not monitor.estimator.signed:
        notes.append("no current is negative: taken as magnitudes, their signs from the balance")
    if "roll" not in log.columns:
        notes.append("no column roll: taken as level from side to side")
    if not terrains.terrain:
        notes.append("no known classes: --terrains selects a file, --learn writes one")
    thresholds = terrains.thresholds
    for key, text in (("soft_above", "hard nor soft"), ("slippery_below", "gripping nor slippery")):
        if getattr(thresholds, key) is None:
            notes.append(f"{terrains.name} has no thresholds.{key}: neither {text} is stated")
    return notes
