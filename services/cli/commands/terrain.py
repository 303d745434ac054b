"""`slopewise terrain`: f_r, μ_t, B_s, class and changes of terrain out of drive logs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.errors import ParameterError
from models.parameters import Model
from models.stop_logs.drive_quality import Suspect, find_suspects, usable
from models.terrain.adaptation import AdaptiveClassifier
from models.terrain.estimator import DriveSample
from models.terrain.log_checks import implausible
from models.terrain.monitor import Classified, GroundChange, TerrainMonitor
from models.terrain.phases import Phase
from models.terrain.resistances import Drivetrain
from models.terrain.rotation_centres import rotation_centres
from models.terrain.signature import Signature
from models.terrain.signature_model import SignatureModel
from models.terrain.trace import TerrainTrace, trace
from services.cli.commands.terrain_result import RunEvents, TerrainResult
from services.cli.screen import progress_bar
from services.io.access import fault
from services.io.logs.drive_log import DriveLog
from services.io.logs.log_source import read_logs
from services.io.model_file import find_model, read_model
from services.io.terrain_file import (
    TerrainFile,
    find_terrains,
    read_signatures_of,
    read_terrains,
    shipped_terrains,
)

NEEDED = ("v_left", "v_right", "yaw_rate", "current_left", "current_right")
RATES = ("roll_rate", "pitch_rate")
ACCELERATIONS = ("accel_x", "accel_y", "accel_z")
_SAME_SPEED = 1e-6  # [m/s]
_CHANNELS = (*NEEDED, "pitch", "roll")


@dataclass(frozen=True, slots=True)
class TerrainJob:
    """What to learn from, as the command line gives it.

    Attributes:
        logs: drive logs. model_file: vehicle and terrain so far.
        terrains: file or name of known classes; those named as the model, if there are, else none.
        adapt: classes go on learning, and new ones arise.
        learn: classes are wanted afterwards; without labels in the log they have to arise.
        topics: topic mapping of ROS 2 recordings.
    """

    logs: list[Path]
    model_file: str
    terrains: str | None = None
    adapt: bool = False
    learn: bool = False
    topics: Path | None = None


def run(job: TerrainJob, *, quiet: bool = False) -> TerrainResult:
    """Read, estimate, classify.

    Raises:
        InputError: names file and field.
    """
    model_path = find_model(job.model_file)
    model = read_model(model_path)
    _check_vehicle(model, str(model_path))
    terrains, signatures = _terrains(job, model)
    log = read_logs(job.logs, job.topics)
    _check_channels(log)
    begin = time.perf_counter()
    rates = _rates(log)
    adaptive = None
    if job.adapt or (job.learn and "terrain" not in log.columns):
        adaptive = AdaptiveClassifier(terrains.classes, terrains.adaptation, terrains.classifier)
    monitor = monitor_of(model, terrains, len(rates), adaptive, signatures)
    suspects = [*find_suspects(log.columns, log.runs)]
    suspects += implausible(log.columns, log.runs, model.vehicle)
    good = usable(len(log.columns["t"]), suspects, _CHANNELS)
    results = []
    with progress_bar("driving", len(log.runs), quiet=quiet) as advance:
        for part in log.runs:
            results.append(_run_events(log, part, good, suspects, rates, monitor))
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
    return TerrainMonitor(
        model, terrains.classes, estimator=terrains.estimator, classifier=terrains.classifier,
        change=terrains.change, adaptive=adaptive, rates=rates, signatures=signatures,
        memory=terrains.memory,
    )  # fmt: skip


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


def _rates(log: DriveLog) -> tuple[str, ...]:
    """Rates of turn that the whole log has."""
    return _whole(log, RATES)


def _whole(log: DriveLog, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(n for n in names if n in log.columns and np.isfinite(log.columns[n]).all())


def rows_of(
    log: DriveLog, part: slice, good: NDArray[np.bool_], rates: tuple[str, ...]
) -> Iterator[tuple[DriveSample, bool, tuple[float, ...], tuple[float, ...]]]:
    """Samples of a run as the monitor takes them."""
    columns = log.columns
    count = part.stop - part.start
    roll = np.nan_to_num(columns["roll"][part]) if "roll" in columns else np.zeros(count)
    turning = [columns[name][part].tolist() for name in rates]
    channels = [columns[name][part].tolist() for name in ("t", *NEEDED, "pitch")]
    return zip(
        map(DriveSample, *channels, roll.tolist()),
        good[part].tolist(),
        list(zip(*turning, strict=True)) if turning else [()] * count,
        _accelerations(log, part),
        strict=True,
    )


def _accelerations(log: DriveLog, part: slice) -> list[tuple[float, ...]]:
    """Of each sample, if the log has all three axes."""
    if len(_whole(log, ACCELERATIONS)) < len(ACCELERATIONS):
        return [()] * (part.stop - part.start)
    columns = [log.columns[name][part].tolist() for name in ACCELERATIONS]
    return list(zip(*columns, strict=True))


def _run_events(
    log: DriveLog, part: slice, good: NDArray[np.bool_], suspects: list[Suspect],
    rates: tuple[str, ...], monitor: TerrainMonitor,
) -> RunEvents:  # fmt: skip
    monitor.begin_run()
    events: list[Classified | GroundChange] = []
    for row in rows_of(log, part, good, rates):
        if found := monitor.update(*row):
            events += found
    events += monitor.finish()
    channels = {*_CHANNELS, "t"}
    excluded = [s for s in suspects if s.channel in channels and part.start <= s.start < part.stop]
    return RunEvents(
        run=str(log.columns["run"][part.start]),
        samples=part,
        events=events,
        excluded=excluded,
        known=monitor.estimator.known,
        labels=_labels(log, part, events),
        signatures=_labelled_signatures(log, part, monitor),
        centres=_centres(log, part, events),
        compared=monitor.change.compared,
        not_compared=monitor.change.not_compared,
    )


def _centres(
    log: DriveLog, part: slice, events: list[Classified | GroundChange]
) -> list[tuple[float, float]]:
    """Centres of rotation (left, right) [m] of each stretch that turns, NaN where not told.

    The log's speed has to be another measurement than the mean of its wheels.
    """
    time, v = log.columns["t"][part], log.columns["v"][part]
    rims = 0.5 * (log.columns["v_left"][part] + log.columns["v_right"][part])
    apart = bool(np.nanmax(np.abs(v - rims), initial=0.0) > _SAME_SPEED)
    found = []
    for event in events:
        if not isinstance(event, Classified):
            continue
        o = event.observation
        if not apart or o.phase not in (Phase.TURN, Phase.SPOT):
            found.append((np.nan, np.nan))
            continue
        inside = slice(*np.searchsorted(time, (o.begin, o.end)))
        half = 0.5 * o.speed_difference
        speed = float(np.nanmean(v[inside])) if inside.stop > inside.start else np.nan
        found.append(rotation_centres(o.speed - half, o.speed + half, speed, o.yaw_rate))
    return found


def _labelled_signatures(
    log: DriveLog, part: slice, monitor: TerrainMonitor
) -> list[tuple[Signature, str]]:
    """Signatures of a run with the log's own name of the ground, empty where it has none."""
    found = monitor.signatures.found
    if "terrain" not in log.columns:
        return [(signature, "") for _, signature in found]
    time = log.columns["t"][part]
    ends = np.array([float(time[0]) + seconds - 2.5 for seconds, _ in found])
    index = np.searchsorted(time, ends).clip(max=part.stop - part.start - 1)
    names = log.columns["terrain"][part][index]
    return [(signature, str(name)) for (_, signature), name in zip(found, names, strict=True)]


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


def _labels(log: DriveLog, part: slice, events: list[Classified | GroundChange]) -> list[str]:
    """The log's own name of the ground in the middle of each stretch, empty where it has none."""
    stretches = [e.observation for e in events if isinstance(e, Classified)]
    if "terrain" not in log.columns:
        return [""] * len(stretches)
    middle = np.array([0.5 * (o.begin + o.end) for o in stretches])
    index = np.searchsorted(log.columns["t"][part], middle).clip(max=part.stop - part.start - 1)
    return [str(name) for name in log.columns["terrain"][part][index]]


def _notes(
    log: DriveLog, terrains: TerrainFile, monitor: TerrainMonitor, *, learn: bool
) -> list[str]:
    notes = []
    if not monitor.estimator.signed:
        notes.append("no current is negative: taken as magnitudes, their signs from the balance")
    if "roll" not in log.columns:
        notes.append("no column roll: taken as level from side to side")
    if not _rates(log):
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
