"""Estimate resistances, slip track, class and changes of terrain from drive logs."""

from __future__ import annotations

import time

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import find_suspects, usable
from slopewise.models.terrain.adaptation import AdaptiveClassifier
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import MonitorSettings, TerrainMonitor
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.terrain.trace import TerrainTrace, trace
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.terrain_file import (
    TerrainFile,
    find_terrains,
    read_signatures_of,
    read_terrains,
    shipped_terrains,
)
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult
from slopewise.services.jobs.terrain_run import (
    CHANNELS,
    NEEDED,
    complete_rates,
    monitor_rows,
    run_events,
)


def terrain(
    logs: LogInput,
    model_file: str,
    *,
    terrains: str | None = None,
    adapt: bool = False,
    learn: bool = False,
    quiet: bool = True,
) -> TerrainResult:
    """Read, estimate, classify.

    Known classes are those of a file or shipped name, by default of the model's name. `adapt`: they
    follow the log, and new ones are added; `learn`: they are an output, without labels in the log
    by adaptation.

    Raises:
        InputError: names file and field.
    """
    model_path = find_model(model_file)
    model = read_model(model_path)
    _check_vehicle(model, str(model_path))
    known, signatures = _read_classes(terrains, model)
    log = logs.read()
    _check_channels(log)
    begin = time.perf_counter()
    rates = complete_rates(log)
    adaptive = None
    if adapt or (learn and "terrain" not in log.columns):
        adaptive = AdaptiveClassifier(known.classes, known.adaptation, known.classifier)
    monitor = _monitor(model, known, len(rates), adaptive, signatures)
    suspects = [*find_suspects(log.columns, log.runs)]
    suspects += implausible(log.columns, log.runs, model.vehicle)
    usable_samples = usable(len(log.columns["t"]), suspects, CHANNELS)
    runs = []
    with progress_bar("driving", len(log.runs), quiet=quiet) as advance:
        for part in log.runs:
            runs.append(run_events(log, part, usable_samples, suspects, rates, monitor))
            advance(1)
    return TerrainResult(
        runs=runs,
        log=log,
        model=model,
        terrains=known,
        classes=known.classes if adaptive is None else adaptive.classes,
        usable_samples=usable_samples,
        seconds=time.perf_counter() - begin,
        notes=_notes(log, known, monitor, runs, learn),
        signatures=signatures,
    )


def trace_run(result: TerrainResult, run: RunEvents) -> TerrainTrace:
    """Estimates of the filter along a run."""
    monitor = _monitor(result.model, result.terrains, 0)
    rows = monitor_rows(result.log, run.samples, result.usable_samples, ())
    return trace(monitor.estimator, (row[:3] for row in rows), result.terrains.filter)


def _monitor(
    model: Model,
    terrains: TerrainFile,
    rate_count: int,
    adaptive: AdaptiveClassifier | None = None,
    signatures: SignatureModel | None = None,
) -> TerrainMonitor:
    settings = MonitorSettings(
        terrains.estimator,
        terrains.classifier,
        terrains.change,
        terrains.memory,
        rate_count,
        keep_signatures=True,
    )
    return TerrainMonitor(
        model, terrains.classes, settings, adaptive=adaptive, signatures=signatures
    )


def _check_vehicle(model: Model, source: str) -> None:
    if model.vehicle.drive != "skid_steer":
        raise fault(source, "vehicle.drive", "expected skid_steer, got ackermann")
    try:
        Drivetrain.of(model.vehicle)
    except ParameterError as error:
        raise fault(source, error.field, f"expected {error.expected}") from None


def _read_classes(name: str | None, model: Model) -> tuple[TerrainFile, SignatureModel | None]:
    if name is not None:
        path = find_terrains(name)
    elif (shipped := shipped_terrains().get(model.name)) is not None:
        path = shipped
    else:
        return TerrainFile(name=model.name), None
    terrains = read_terrains(path)
    return terrains, read_signatures_of(terrains, path)


def _check_channels(log: DriveLog) -> None:
    for part, source in zip(log.runs, log.sources, strict=True):
        for name in NEEDED:
            if name not in log.columns or np.isnan(log.columns[name][part]).all():
                missing = f"missing column, expected {', '.join(NEEDED)} and run,t,v,v_cmd,pitch"
                raise fault(source, f"column {name}", missing)


def _notes(
    log: DriveLog, known: TerrainFile, monitor: TerrainMonitor, runs: list[RunEvents], learn: bool
) -> tuple[str, ...]:
    notes = []
    if not monitor.estimator.signed:
        notes.append("no current is negative: taken as magnitudes, their signs from the balance")
    if "roll" not in log.columns:
        notes.append("no column roll: taken as level from side to side")
    if not complete_rates(log):
        notes.append("no columns roll_rate, pitch_rate: changes are detected from fewer channels")
    if not known.terrain and learn:
        notes.append("no classes known before: those learned now are in the file")
    elif not known.terrain:
        notes.append("no classes known: --terrains gives some, --learn makes them")
    if missed := sum(run.not_compared for run in runs):
        steady = missed + sum(run.compared for run in runs)
        notes.append(
            f"changes: {missed} of {steady} steady seconds could not be compared, no similar "
            "driving came before them"
        )
    return tuple(notes)
