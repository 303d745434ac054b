"""One run of a drive log through the terrain monitor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.estimator import DriveSample
from slopewise.models.terrain.monitor import Classified, GroundChange, TerrainMonitor
from slopewise.models.terrain.observation import GroundObservation
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.rotation_centres import rotation_centres
from slopewise.models.terrain.signature import Signature
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.jobs.terrain_result import RunEvents

NEEDED = ("v_left", "v_right", "yaw_rate", "current_left", "current_right")
RATES = ("roll_rate", "pitch_rate")
ACCELERATIONS = ("accel_x", "accel_y", "accel_z")
CHANNELS = (*NEEDED, "pitch", "roll")
_SAME_SPEED = 1e-6
"""Difference below which the log's speed is the mean of its wheels [m/s]: rounding of a table."""


def complete_rates(log: DriveLog) -> tuple[str, ...]:
    """Body rates that every sample of the log has."""
    return _complete(log, RATES)


def _complete(log: DriveLog, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(n for n in names if n in log.columns and np.isfinite(log.columns[n]).all())


def monitor_rows(
    log: DriveLog, part: slice, usable_samples: NDArray[np.bool_], rates: tuple[str, ...]
) -> Iterator[tuple[DriveSample, bool, tuple[float, ...], tuple[float, ...]]]:
    """Samples of a run in the order of the monitor's arguments."""
    columns = log.columns
    count = part.stop - part.start
    roll = np.nan_to_num(columns["roll"][part]) if "roll" in columns else np.zeros(count)
    turning = [columns[name][part].tolist() for name in rates]
    channels = [columns[name][part].tolist() for name in ("t", *NEEDED, "pitch")]
    return zip(
        map(DriveSample, *channels, roll.tolist()),
        usable_samples[part].tolist(),
        list(zip(*turning, strict=True)) if turning else [()] * count,
        _accelerations(log, part),
        strict=True,
    )


def _accelerations(log: DriveLog, part: slice) -> list[tuple[float, ...]]:
    """Accelerations of each sample, empty unless the log has all three axes."""
    if len(_complete(log, ACCELERATIONS)) < len(ACCELERATIONS):
        return [()] * (part.stop - part.start)
    columns = [log.columns[name][part].tolist() for name in ACCELERATIONS]
    return list(zip(*columns, strict=True))


def run_events(
    log: DriveLog,
    part: slice,
    usable_samples: NDArray[np.bool_],
    suspects: list[Suspect],
    rates: tuple[str, ...],
    monitor: TerrainMonitor,
) -> RunEvents:
    """Drive the monitor through a run."""
    monitor.begin_run()
    events: list[Classified | GroundChange] = []
    for row in monitor_rows(log, part, usable_samples, rates):
        events += monitor.update(*row)
    events += monitor.finish()
    stretches = [event.observation for event in events if isinstance(event, Classified)]
    channels = {*CHANNELS, "t"}
    excluded = [s for s in suspects if s.channel in channels and part.start <= s.start < part.stop]
    return RunEvents(
        run=str(log.columns["run"][part.start]),
        samples=part,
        events=events,
        excluded=excluded,
        known=monitor.estimator.known,
        labels=_names_at(log, part, [0.5 * (o.begin + o.end) for o in stretches]),
        signatures=_labelled_signatures(log, part, monitor),
        centres=_centres(log, part, stretches),
        compared=monitor.change.compared,
        not_compared=monitor.change.not_compared,
    )


def _centres(
    log: DriveLog, part: slice, stretches: list[GroundObservation]
) -> list[tuple[float, float]]:
    """Centres of rotation (left, right) [m] of each stretch that turns, NaN if not observable.

    The log's speed has to be another measurement than the mean of its wheels.
    """
    time, v = log.columns["t"][part], log.columns["v"][part]
    rims = 0.5 * (log.columns["v_left"][part] + log.columns["v_right"][part])
    is_independent = bool(np.nanmax(np.abs(v - rims), initial=0.0) > _SAME_SPEED)
    centres = []
    for o in stretches:
        if not is_independent or o.phase not in (Phase.TURN, Phase.SPOT):
            centres.append((np.nan, np.nan))
            continue
        inside = slice(*np.searchsorted(time, (o.begin, o.end)))
        half = 0.5 * o.speed_difference
        speed = float(np.nanmean(v[inside])) if inside.stop > inside.start else np.nan
        centres.append(rotation_centres(o.speed - half, o.speed + half, speed, o.yaw_rate))
    return centres


def _labelled_signatures(
    log: DriveLog, part: slice, monitor: TerrainMonitor
) -> list[tuple[Signature, str]]:
    """Signatures of a run with the log's own name of the ground, empty where it has none."""
    signatures = monitor.signatures.found
    first = float(log.columns["t"][part.start])
    names = _names_at(log, part, [first + seconds - 2.5 for seconds, _ in signatures])
    return [(signature, name) for (_, signature), name in zip(signatures, names, strict=True)]


def _names_at(log: DriveLog, part: slice, times: list[float]) -> list[str]:
    """The log's own name of the ground at each time, empty where it has none."""
    if "terrain" not in log.columns:
        return [""] * len(times)
    index = np.searchsorted(log.columns["t"][part], times).clip(max=part.stop - part.start - 1)
    return [str(name) for name in log.columns["terrain"][part][index]]
