"""One run of a drive log through the terrain monitor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.estimator import DriveSample
from slopewise.models.terrain.monitor import DescribedStretch, Event, TerrainMonitor
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.rotation_centres import rotation_centres
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.jobs.terrain_result import RunEvents

NEEDED = ("v_left", "v_right", "yaw_rate", "current_left", "current_right")
CHANNELS = (*NEEDED, "pitch", "roll")
_SAME_SPEED = 1e-6
"""Difference below which the log's speed is the mean of its wheels [m/s]: rounding of a table."""


def monitor_rows(
    log: DriveLog, part: slice, usable_samples: NDArray[np.bool_]
) -> Iterator[tuple[DriveSample, bool]]:
    """Samples of a run in the order of the monitor's arguments."""
    columns = log.columns
    count = part.stop - part.start
    roll = np.nan_to_num(columns["roll"][part]) if "roll" in columns else np.zeros(count)
    channels = [columns[name][part].tolist() for name in ("t", *NEEDED, "pitch")]
    samples = map(DriveSample, *channels, roll.tolist())
    return zip(samples, usable_samples[part].tolist(), strict=True)


def run_events(
    log: DriveLog,
    part: slice,
    usable_samples: NDArray[np.bool_],
    suspects: list[Suspect],
    monitor: TerrainMonitor,
) -> RunEvents:
    """Send a run through the monitor."""
    monitor.begin_run()
    events: list[Event] = []
    for row in monitor_rows(log, part, usable_samples):
        events += monitor.update(*row)
    events += monitor.finish()
    channels = {*CHANNELS, "t"}
    excluded = [s for s in suspects if s.channel in channels and part.start <= s.start < part.stop]
    stretches = [event for event in events if isinstance(event, DescribedStretch)]
    return RunEvents(
        run=str(log.columns["run"][part.start]),
        samples=part,
        events=events,
        excluded=excluded,
        known=monitor.estimator.known,
        labels=_texts(log, part, stretches, "terrain"),
        sessions=_texts(log, part, stretches, "session"),
        centres=_centres(log, part, stretches),
        is_relied_on=monitor.describer.describe(relied_on=True).is_decided,
    )


def _centres(
    log: DriveLog, part: slice, stretches: list[DescribedStretch]
) -> list[tuple[float, float]]:
    """Centres of rotation (left, right) [m] of each stretch that turns, NaN if not observable.

    The log's speed has to be another measurement than the mean of its wheels.
    """
    time, v = log.columns["t"][part], log.columns["v"][part]
    rims = 0.5 * (log.columns["v_left"][part] + log.columns["v_right"][part])
    is_independent = bool(np.nanmax(np.abs(v - rims), initial=0.0) > _SAME_SPEED)
    centres = []
    for o in (stretch.observation for stretch in stretches):
        if not is_independent or o.phase not in (Phase.TURN, Phase.SPOT):
            centres.append((np.nan, np.nan))
            continue
        inside = slice(*np.searchsorted(time, (o.begin, o.end)))
        half = 0.5 * o.speed_difference
        speed = float(np.nanmean(v[inside])) if inside.stop > inside.start else np.nan
        centres.append(rotation_centres(o.speed - half, o.speed + half, speed, o.yaw_rate))
    return centres


def _texts(log: DriveLog, part: slice, stretches: list[DescribedStretch], name: str) -> list[str]:
    """A text column in the middle of each stretch, empty where the log has none."""
    observations = [stretch.observation for stretch in stretches]
    if name not in log.columns:
        return [""] * len(observations)
    middle = np.array([0.5 * (o.begin + o.end) for o in observations])
    index = np.searchsorted(log.columns["t"][part], middle).clip(max=part.stop - part.start - 1)
    return [str(text) for text in log.columns[name][part][index]]
