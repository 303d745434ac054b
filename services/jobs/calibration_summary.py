"""A calibration as `calibrate --json` prints it, and its stops as a table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learn import Calibration
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.table import write_rows
from slopewise.services.jobs.calibrate import CalibrateResult, RejectedLogError
from slopewise.services.jobs.summary import Summary

_STOP_COLUMNS = ("run", "t", "verdict", "reason", "speed")
"""Columns of the table of stops, before those of a stop that was measured."""


class Coefficient(Summary, frozen=True):
    """A coefficient; `learned`: share of it that comes from the stops [1]."""

    value: float
    std: float
    learned: float


class PromiseSummary(Summary, frozen=True):
    """Shares that stops support: `counted_here` in sessions of the log, `counted_new` in new ones.

    Each session is predicted from the others: of `held_out` stops `held_out_beyond` were longer
    than allowed; `interval` is 95 % of that share, exact, null where no session was predicted.
    """

    share: float
    stops: int
    sessions: int
    counted_here: float
    counted_new: float
    held_out: int
    held_out_beyond: int
    interval: list[float] | None
    held_out_excess_m: float | None
    more_stops: int
    more_sessions: int
    text: str


class SurfaceSummary(Summary, frozen=True):
    """Braking on one surface, "" for the base; keys as in model files.

    `stop_factor` is the largest ratio of allowed to predicted distance at the promised share;
    `coverage` the share of stops within what plans allow, `mean_excess` what these allow more [m].
    """

    name: str
    stops: int
    left_out: int
    coefficients: dict[str, Coefficient]
    covariance: list[list[float]]
    scatter: float
    promise: PromiseSummary
    stop_factor: float
    two_stages: list[float] | None
    time_offset: float
    speed_range: list[float]
    grade_range: list[float]
    coverage: float
    mean_excess: float


class SuspectRow(Summary, frozen=True):
    """A part of a channel that was excluded, from start to end [s]."""

    start: float
    end: float
    channel: str
    kind: str
    reason: str


class CalibrationSummary(Summary, frozen=True):
    """Output of `calibrate --json`; `sheet`: numbers of the brake sheet, if it was written.

    `tracking`: table and laws that were learned of the errors of poses from their paths;
    absent without poses and paths in the log.
    """

    stops: dict[str, int]
    dead_time: dict[str, float]
    dive: dict[str, float]
    mount: dict[str, Any]
    speed_error: dict[str, float] | None
    surfaces: list[SurfaceSummary]
    suspects: list[SuspectRow]
    levels: dict[str, float] | None
    warnings: list[str]
    objections: list[str]
    seconds: float
    sheet: dict[str, Any] | None = None
    tracking: dict[str, Any] | None = None


def summarise(result: CalibrateResult, sheet: dict[str, Any] | None = None) -> CalibrationSummary:
    """Everything that was fitted, SI units and radians."""
    c, t = result.calibration, result.log.columns["t"]
    dead_time, dive, mount = c.dead_time, c.dive, c.mount
    scatter = dead_time.between_stops
    return CalibrationSummary.of(
        c,
        stops={"found": len(c.windows), **c.verdicts},
        dead_time={"value": dead_time.value, "std": dead_time.std, "jitter": scatter},
        dive={"value": dive.per_deceleration, "std": dive.std, "settling": dive.settling},
        mount={"value": mount.offset, "std": mount.std, "source": mount.source},
        speed_error=None if c.speed_error is None else asdict(c.speed_error),
        surfaces=[surface_summary(s) for s in c.surfaces],
        suspects=[
            SuspectRow(float(t[s.start]), float(t[s.stop - 1]), s.channel, s.kind.value, s.reason)
            for s in c.suspects
        ],
        levels=None if c.levels is None else asdict(c.levels),
        seconds=result.seconds,
        sheet=sheet,
        tracking=None if result.tracking is None else asdict(result.tracking),
    )


def surface_summary(s: SurfaceFit) -> SurfaceSummary:
    """Everything that was fitted on one surface.

    Allowed distances are at the promised share; stops that the fit excludes are included here.
    """
    std = np.sqrt(np.diag(s.fit.covariance))
    numbers = zip(NAMES, s.fit.coefficients, std, s.fit.learned, strict=True)
    margin = np.array([r.distance_margin for r in s.records])
    finite = margin[np.isfinite(margin)]
    return SurfaceSummary.of(
        s,
        stops=len(s.records),
        left_out=sum(not r.kept for r in s.records),
        coefficients={n: Coefficient(float(v), float(e), float(k)) for n, v, e, k in numbers},
        covariance=s.fit.covariance.tolist(),
        scatter=s.fit.scatter,
        promise=PromiseSummary.of(
            s.promise, held_out_excess_m=s.promise.excess, text=s.promise.sentence()
        ),
        stop_factor=s.distance.table.worst(s.promise.share),
        coverage=float(np.mean(margin >= 0.0)),
        mean_excess=float(np.mean(finite)) if len(finite) else 0.0,
    )


def surface_rows(c: Calibration) -> dict[str, list[str]]:
    """Table of the surfaces: label -> one cell each, formatted."""
    columns = [_cells(surface_summary(s)) for s in c.surfaces]
    return {label: [cells[label] for cells in columns] for label in columns[0]}


def _cells(s: SurfaceSummary) -> dict[str, str]:
    low, high = np.rad2deg(s.grade_range)
    per_speed = {"m_m": "m_m, s/m", "m_b": "m_b, s/m"}
    return {
        **{
            per_speed.get(name, name): f"{c.value:+.4f} ± {c.std:.4f}"
            for name, c in s.coefficients.items()
        },
        "stops learned from": f"{s.stops - s.left_out} of {s.stops}",
        "sessions": f"{s.promise.sessions}",
        f"allowed at {s.promise.share:g}, times predicted": f"up to {s.stop_factor:.2f}",
        "counted, these sessions": f"{s.promise.counted_here:.1%}",
        "counted, new sessions": f"{s.promise.counted_new:.1%}",
        "held-out sessions, beyond": f"{s.promise.held_out_beyond} of {s.promise.held_out}",
        "time offset, s": f"{s.time_offset:.3f}",
        "stops within what plans allow": f"{s.coverage:.1%}",
        "allowed longer by, mean m": f"{s.mean_excess:.3f}",
        "speeds, m/s": f"{s.speed_range[0]:.2f} … {s.speed_range[1]:.2f}",
        "grades": f"{low:.1f}° … {high:.1f}°",
    }


def write_stops(result: CalibrateResult, path: Path) -> None:
    """Write one row per stop, SI units; empty where a stop was not measured."""
    surfaces = result.calibration.surfaces
    records = {r.samples.window.command: r for s in surfaces for r in s.records}
    offsets = {s.name: s.time_offset for s in surfaces}
    rows = []
    for window in result.calibration.windows:
        record = records.get(window.command)
        state = window.verdict.name.lower() if record or not window.usable else "unused"
        measured = {} if record is None else _measured(record, offsets)
        rows.append(_stop_row(result.log, window, state, window.reason) | measured)
    _write(rows, path)


def write_rejected_stops(rejected: RejectedLogError, path: Path) -> None:
    rows = [
        _stop_row(rejected.log, w, w.verdict.name.lower(), w.reason or w.verdict.value)
        for w in rejected.windows
    ]
    _write(rows, path)


def _stop_row(log: DriveLog, window: StopWindow, verdict: str, reason: str) -> dict[str, Any]:
    run, t = log.columns["run"][window.command], log.columns["t"][window.command]
    values = (str(run), float(t), verdict, reason, window.held_speed)
    return dict(zip(_STOP_COLUMNS, values, strict=True))


def _write(rows: list[dict[str, Any]], path: Path) -> None:
    names = max(rows, key=len, default=_STOP_COLUMNS)
    write_rows(rows, names, ("run", "verdict", "reason"), path)


def _measured(r: StopRecord, offsets: dict[str, float]) -> dict[str, float]:
    """Columns of a stop that was measured: m, s, m/s, rad, share of the weight."""
    return {
        "onset_speed": r.onset_speed,
        "onset_time": r.knee.onset_time,
        "grade": r.grade,
        "force_ratio": r.force_ratio,
        "force_std": r.force_std,
        "distance": r.samples.distance,
        "time": r.samples.standstill_time,
        "predicted_distance": r.predicted_distance,
        "predicted_with_offset": r.bound_distance,
        "predicted_time": r.predicted_time,
        "predicted_time_with_offset": r.predicted_time
        + offsets.get(r.samples.terrain, offsets[""]),
        "kept": float(r.kept),
    }
