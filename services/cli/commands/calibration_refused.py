"""What `slopewise calibrate` leaves behind where it refuses a log: its stops, and why not."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import numpy as np

from slopewise.models.errors import InputError
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, find_stops
from slopewise.services.cli.arguments.files import CalibrateOptions
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.table import write_csv


def leave(log: DriveLog, stops: StopSettings, job: CalibrateOptions, error: InputError) -> None:
    """Write the files that were asked for, as far as the log tells them.

    Args:
        log: that is refused. stops: what counts as one. job: files. error: why it is refused.
    """
    if job.stops is None and job.report is None:
        return
    suspects = find_suspects(log.columns, log.runs)
    good = usable(len(log.columns["t"]), suspects, ["v", "v_cmd"])
    windows = [w for run in log.runs for w in find_stops(log.columns, run, good, stops)]
    if job.stops is not None:
        write_csv(_rows(log, windows), job.stops)
    if job.report is not None:
        _write_page(log, windows, suspects, job, error)


def _rows(log: DriveLog, windows: list[StopWindow]) -> dict[str, Any]:
    at = [w.command for w in windows]
    return {
        "run": [str(log.columns["run"][i]) for i in at],
        "t": np.array([log.columns["t"][i] for i in at], np.float64),
        "verdict": [w.verdict.name.lower() for w in windows],
        "reason": [w.reason or w.verdict.value for w in windows],
        "speed": np.array([w.held_speed for w in windows], np.float64),
    }


def _write_page(
    log: DriveLog,
    windows: list[StopWindow],
    suspects: tuple[Suspect, ...],
    job: CalibrateOptions,
    error: InputError,
) -> None:
    from slopewise.services.report.calibration_page import RejectedLog, write_rejected_log

    assert job.report is not None
    run, t = log.columns["run"], log.columns["t"]
    rejected = RejectedLog(
        str(error),
        windows,
        [f"{run[w.command]}, {t[w.command]:.2f} s" for w in windows],
        suspects,
        {s.start: float(t[s.start]) for s in suspects},
    )
    provenance = {
        "logs": ", ".join(file.name for file in job.logs),
        "model so far": job.model,
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    title = "Brakes that were not learned"
    write_rejected_log(job.report, rejected, title=title, provenance=provenance)
