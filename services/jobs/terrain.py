"""Estimate resistances, slip track, description and changes of terrain from drive logs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from slopewise.models.laws.slip_track import rotation_centres
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.terrain.description import GroundChange
from slopewise.models.terrain.estimator import DriveSample
from slopewise.models.terrain.log_checks import implausible
from slopewise.models.terrain.monitor import DescribedStretch, Event, TerrainMonitor
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.terrain.trace import TerrainTrace, trace
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault, faults_of, shipped_files
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.terrain_file import TerrainFile, find_terrains, read_terrains
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.terrain_result import LoggedStretch, RunEvents, TerrainResult

NEEDED = ("v_left", "v_right", "yaw_rate", "current_left", "current_right")
CHANNELS = (*NEEDED, "pitch", "roll")
_SAME_SPEED = 1e-6
"""Difference below which the log's speed is the mean of its wheels [m/s]: rounding of a table."""


def terrain(logs: LogInput, model_file: str, *, terrains: str | None = None) -> TerrainResult:
    """Read, estimate, describe.

    `terrains`: terrain file or shipped name, by default that of the model's name.
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
    with progress_bar("driving", len(log.runs)) as advance:
        for part in log.runs:
            runs.append(_run_events(log, part, usable_samples, suspects, monitor))
            advance(1)
    return TerrainResult(
        runs=runs,
        log=log,
        model=model,
        terrains=known,
        usable_samples=usable_samples,
        seconds=time.perf_counter() - begin,
        notes=tuple(_notes(log, model, known, monitor, str(model_path))),
    )


def trace_run(result: TerrainResult, run: RunEvents) -> TerrainTrace:
    """Estimates of the filter along a run."""
    monitor = _monitor(result.model, result.terrains)
    rows = _monitor_rows(result.log, run.samples, result.usable_samples)
    return trace(monitor.estimator, rows, result.terrains.filter)


def _monitor(model: Model, terrains: TerrainFile) -> TerrainMonitor:
    return TerrainMonitor(model, terrains.classes, terrains.thresholds, terrains.estimator)


def _check_vehicle(model: Model, source: str) -> None:
    if model.vehicle.drive != "skid_steer":
        raise fault(source, "vehicle.drive", "expected skid_steer, got ackermann")
    with faults_of(source):
        Drivetrain.of(model.vehicle)


def _read_terrains(name: str | None, model: Model) -> TerrainFile:
    if name is not None:
        return read_terrains(find_terrains(name))
    shipped = shipped_files("terrains").get(model.name)
    return TerrainFile(name=model.name) if shipped is None else read_terrains(shipped)


def _check_channels(log: DriveLog) -> None:
    for part, source in zip(log.runs, log.sources, strict=True):
        for name in NEEDED:
            if name not in log.columns or np.isnan(log.columns[name][part]).all():
                missing = f"missing column, expected {', '.join(NEEDED)} and run,t,v,v_cmd,pitch"
                raise fault(source, f"column {name}", missing)


def _notes(
    log: DriveLog, model: Model, terrains: TerrainFile, monitor: TerrainMonitor, model_path: str
) -> list[str]:
    notes = []
    if message := monitor.vehicle_check.message():
        notes.append(f"{model_path}: {message}")
    if not monitor.estimator.signed:
        notes.append("no current is negative: taken as magnitudes, their signs from the balance")
    if model.vehicle.idle_current is None:
        notes.append("no idle_current in the model file: f_r includes what idling motors take")
    if "roll" not in log.columns:
        notes.append("no column roll: taken as level from side to side")
    if not terrains.terrain:
        notes.append("no known classes: --terrains selects a file, --learn writes one")
    thresholds = terrains.thresholds
    for key, text in (("soft_above", "hard nor soft"), ("slippery_below", "gripping nor slippery")):
        if getattr(thresholds, key) is None:
            notes.append(f"{terrains.name} has no thresholds.{key}: neither {text} is stated")
    return notes


def _monitor_rows(
    log: DriveLog, part: slice, usable_samples: NDArray[np.bool_]
) -> Iterator[tuple[DriveSample, bool]]:
    """Samples of a run in the order of the monitor's arguments."""
    columns = log.columns
    count = part.stop - part.start
    roll = np.nan_to_num(columns["roll"][part]) if "roll" in columns else np.zeros(count)
    channels = [columns[name][part].tolist() for name in ("t", *NEEDED, "pitch")]
    samples = map(DriveSample, *channels, roll.tolist())
    return zip(samples, usable_samples[part].tolist(), strict=True)


def _run_events(
    log: DriveLog,
    part: slice,
    usable_samples: NDArray[np.bool_],
    suspects: list[Suspect],
    monitor: TerrainMonitor,
) -> RunEvents:
    """Send a run through the monitor."""
    monitor.begin_run()
    events: list[Event] = []
    for row in _monitor_rows(log, part, usable_samples):
        events += monitor.update(*row)
    events += monitor.finish()
    channels = {*CHANNELS, "t"}
    excluded = [s for s in suspects if s.channel in channels and part.start <= s.start < part.stop]
    v, rims = log.columns["v"][part], 0.5 * (log.columns["v_left"] + log.columns["v_right"])[part]
    has_speed = bool(np.nanmax(np.abs(v - rims), initial=0.0) > _SAME_SPEED)
    return RunEvents(
        run=str(log.columns["run"][part.start]),
        samples=part,
        stretches=[
            _logged(log, part, event, has_speed)
            for event in events
            if isinstance(event, DescribedStretch)
        ],
        changes=[event for event in events if isinstance(event, GroundChange)],
        excluded=excluded,
        known=monitor.estimator.known,
        is_relied_on=monitor.describer.describe(relied_on=True).is_decided,
    )


def _logged(log: DriveLog, part: slice, event: DescribedStretch, has_speed: bool) -> LoggedStretch:
    """A stretch with the log's texts in its middle, and the centres of rotation of a turn.

    Centres are observable only where the log's speed is another measurement than the mean of its
    wheels.
    """
    o, time = event.observation, log.columns["t"][part]
    middle = int(np.searchsorted(time, 0.5 * (o.begin + o.end)).clip(max=len(time) - 1))
    label, session = (
        str(log.columns[name][part][middle]) if name in log.columns else ""
        for name in ("terrain", "session")
    )
    centres = (np.nan, np.nan)
    if has_speed and o.phase in (Phase.TURN, Phase.SPOT):
        inside = slice(*np.searchsorted(time, (o.begin, o.end)))
        half = 0.5 * o.speed_difference
        driven = log.columns["v"][part][inside]
        speed = float(np.nanmean(driven)) if len(driven) else np.nan
        centres = rotation_centres(o.speed - half, o.speed + half, speed, o.yaw_rate)
    given = {field.name: getattr(event, field.name) for field in fields(event)}
    return LoggedStretch(**given, label=label, session=session, centres=centres)
