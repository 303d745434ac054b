"""`slopewise terrain`: f_r, μ_t, B_s, class and changes of terrain out of drive logs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

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
from slopewise.services.cli.commands.terrain_result import RunEvents, TerrainResult
from slopewise.services.cli.commands.terrain_run import (
    CHANNELS,
    NEEDED,
    rates_of,
    rows_of,
    run_events,
)
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.terrain_file import (
    TerrainFile,
    find_terrains,
    read_signatures_of,
    read_terrains,
    shipped_terrains,
)


@dataclass(frozen=True, slots=True)
class TerrainJob:
    """What to learn from, as the command line gives it.

    Attributes:
        logs: drive logs. model_file: vehicle and terrain so far.
        terrains: file or name of known classes; those named as the model, if there are, else none.
        adapt: classes go on learning, and new ones arise.
        learn: classes are wanted afterwards; without labels in the log they have to arise.
        topics: topic mapping of ROS 2 recordings.
        columns: of tables that have other names or units.
    """

    logs: list[Path]
    model_file: str
    terrains: str | None = None
    adapt: bool = False
    learn: bool = False
    topics: Path | None = None
    columns: str = ""


def run(job: TerrainJob, *, quiet: bool = False) -> TerrainResult:
    """Read, estimate, classify.

    Raises:
        InputError: names file and field.
    """
    model_path = find_model(job.model_file)
    model = read_model(model_path)
    _check_vehicle(model, str(model_path))
    terrains, signatures = _terrains(job, model)
    log = read_logs(job.logs, job.topics, job.columns)
    _check_channels(log)
    begin = time.perf_counter()
    rates = rates_of(log)
    adaptive = None
    if job.adapt or (job.learn and "terrain" not in log.columns):
        adaptive = AdaptiveClassifier(terrains.classes, terrains.adaptation, terrains.classifier)
    monitor = monitor_of(model, terrains, len(rates), adaptive, signatures)
    suspects = [*find_suspects(log.columns, log.runs)]
    suspects += implausible(log.columns, log.runs, model.vehicle)
    good = usable(len(log.columns["t"]), suspects, CHANNELS)
    results = []
    with progress_bar("driving", len(log.runs), quiet=quiet) as advance:
        for part in log.runs:
            results.append(run_events(log, part, good, suspects, rates, monitor))
            advance(1)
    return TerrainResult(
        runs=results,
        log=log,
        model=model,
        terrains=terrains,
        classes=terrains.classes if adaptive is None else adaptive.classes,
        good=good,
        seconds=time.perf_counter() - begin,
        notes=_notes(log, terrains, monitor, learn=job.learn) + _not_compared(results),
        signatures=signatures,
    )


def monitor_of(
    model: Model,
    terrains: TerrainFile,
    rates: int,
    adaptive: AdaptiveClassifier | None = None,
    signatures: SignatureModel | None = None,
) -> TerrainMonitor:
    """The monitor that a model and a terrain file describe."""
    settings = MonitorSettings(
        terrains.estimator,
        terrains.classifier,
        terrains.change,
        terrains.memory,
        rates,
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


def _terrains(job: TerrainJob, model: Model) -> tuple[TerrainFile, SignatureModel | None]:
    if job.terrains is not None:
        path = find_terrains(job.terrains)
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
                words = f"missing column, expected {', '.join(NEEDED)} beside run,t,v,v_cmd,pitch"
                raise fault(source, f"column {name}", words)


def _not_compared(runs: list[RunEvents]) -> list[str]:
    """What the search for changes could not look at."""
    silent = sum(one.not_compared for one in runs)
    total = silent + sum(one.compared for one in runs)
    if not silent:
        return []
    return [
        f"changes: {silent} of {total} steady seconds could not be compared, nothing driven alike "
        "came before them"
    ]


def _notes(
    log: DriveLog, terrains: TerrainFile, monitor: TerrainMonitor, *, learn: bool
) -> list[str]:
    notes = []
    if not monitor.estimator.signed:
        notes.append("no current is negative: taken as magnitudes, their signs from the balance")
    if "roll" not in log.columns:
        notes.append("no column roll: taken as level from side to side")
    if not rates_of(log):
        notes.append("no columns roll_rate, pitch_rate: changes are told from fewer channels")
    if not terrains.terrain and learn:
        notes.append("no classes known before: those learned now are in the file")
    elif not terrains.terrain:
        notes.append("no classes known: --terrains gives some, --learn makes them")
    return notes


def trace_of(result: TerrainResult, one: RunEvents) -> TerrainTrace:
    """How the filter went through a run."""
    monitor = monitor_of(result.model, result.terrains, 0)
    rows = (row[:3] for row in rows_of(result.log, one.samples, result.good, ()))
    return trace(monitor.estimator, rows, result.terrains.filter)
