"""A calibration as `calibrate --json` prints it, and its stops as a table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.calibration.brake_states import WeakerState
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.services.io.table import write_csv
from slopewise.services.jobs.calibrate import CalibrateResult, RejectedLogError
from slopewise.services.jobs.summary import Summary

_TEXTS = ("run", "verdict", "reason")
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
"""Columns of a stop that was measured: m, s, m/s, rad, share of the weight."""


class Coefficient(Summary, frozen=True):
    """A coefficient; `learned`: share of it that comes from the stops [1]."""

    value: float
    std: float
    learned: float


class WeakerBrakes(Summary, frozen=True):
    """A weaker state of the brakes, as a ratio of the force of the others."""

    stops: int
    ratio: float
    ratio_std: float
    force_scatter: float


class SurfaceSummary(Summary, frozen=True):
    """Braking on one surface, "" for the base; keys as in model files.

    Attributes:
        coverage: share of stops within the prediction of a fit without them.
        mean_excess: mean of predicted minus actual distance [m].
    """

    name: str
    stops: int
    left_out: int
    coefficients: dict[str, Coefficient]
    covariance: list[list[float]]
    scatter: float
    force_std: float
    force_scatter: float
    dead_time_std: float
    state: WeakerBrakes | None
    two_stages: list[float] | None
    distance_offset: float
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
    """Output of `calibrate --json`; `sheet`: numbers of the brake sheet, if it was written."""

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


def summarise(result: CalibrateResult, sheet: dict[str, Any] | None = None) -> CalibrationSummary:
    """Everything that was fitted, SI units and radians."""
    c = result.calibration
    t = result.log.columns["t"]
    dead_time, dive, mount = c.dead_time, c.dive, c.mount
    return CalibrationSummary(
        stops={"found": len(c.windows), **c.verdicts},
        dead_time={
            "value": dead_time.value,
            "std": dead_time.std,
            "jitter": dead_time.between_stops,
        },
        dive={"value": dive.per_deceleration, "std": dive.std, "settling": dive.settling},
        mount={"value": mount.offset, "std": mount.std, "source": mount.source},
        speed_error=None if c.speed_error is None else asdict(c.speed_error),
        surfaces=[_surface(s) for s in c.surfaces],
        suspects=[
            SuspectRow(float(t[s.start]), float(t[s.stop - 1]), s.channel, s.kind.value, s.reason)
            for s in c.suspects
        ],
        levels=None if c.levels is None else asdict(c.levels),
        warnings=list(c.warnings),
        objections=list(c.objections),
        seconds=result.seconds,
        sheet=sheet,
    )


def cross_validation(surface: SurfaceFit) -> tuple[float, float]:
    """Share of measured stops that end within the prediction, and mean distance to spare [m].

    Each prediction is of a fit without the stop, at the quantile of the margins; stops that the fit
    excludes are included here. Infinite predictions are excluded from the mean.
    """
    excess = np.array([r.bound_distance - r.samples.distance for r in surface.records])
    finite = excess[np.isfinite(excess)]
    return float(np.mean(excess >= 0.0)), float(np.mean(finite)) if len(finite) else 0.0


def _surface(s: SurfaceFit) -> SurfaceSummary:
    std = np.sqrt(np.diag(s.fit.covariance))
    numbers = zip(NAMES, s.fit.coefficients, std, s.fit.learned, strict=True)
    share, excess = cross_validation(s)
    return SurfaceSummary(
        name=s.name,
        stops=len(s.records),
        left_out=sum(not r.kept for r in s.records),
        coefficients={n: Coefficient(float(v), float(e), float(k)) for n, v, e, k in numbers},
        covariance=s.fit.covariance.tolist(),
        scatter=s.fit.scatter,
        force_std=s.margins.force.absolute,
        force_scatter=s.margins.force.relative,
        dead_time_std=s.margins.dead_time,
        state=_weaker(s.state),
        two_stages=None if s.two_stages is None else s.two_stages.tolist(),
        distance_offset=s.distance_offset,
        time_offset=s.time_offset,
        speed_range=list(s.speed_range),
        grade_range=list(s.grade_range),
        coverage=share,
        mean_excess=excess,
    )


def _weaker(state: WeakerState | None) -> WeakerBrakes | None:
    if state is None:
        return None
    return WeakerBrakes(int(state.members.sum()), state.ratio, state.ratio_std, state.scatter)


def write_stops(result: CalibrateResult, path: Path) -> None:
    """Write one row per stop, SI units; empty where a stop was not measured."""
    surfaces, columns = result.calibration.surfaces, result.log.columns
    records = {r.samples.window.command: r for s in surfaces for r in s.records}
    offsets = {s.name: s.time_offset for s in surfaces}
    rows = []
    for window in result.calibration.windows:
        record = records.get(window.command)
        state = window.verdict.name.lower() if record or not window.usable else "unused"
        run, t = str(columns["run"][window.command]), float(columns["t"][window.command])
        measured = [np.nan] * len(_MEASURED) if record is None else _measured(record, offsets)
        rows.append((run, t, state, window.reason, window.held_speed, *measured))
    _write(rows, ("run", "t", "verdict", "reason", "speed", *_MEASURED), path)


def write_rejected_stops(rejected: RejectedLogError, path: Path) -> None:
    """Write one row per stop of a log that calibration rejects."""
    columns = rejected.log.columns
    rows = [
        (
            str(columns["run"][w.command]),
            float(columns["t"][w.command]),
            w.verdict.name.lower(),
            w.reason or w.verdict.value,
            w.held_speed,
        )
        for w in rejected.windows
    ]
    _write(rows, ("run", "t", "verdict", "reason", "speed"), path)


def _write(rows: list[Any], names: tuple[str, ...], path: Path) -> None:
    columns = dict(zip(names, zip(*rows, strict=True) if rows else [()] * len(names), strict=True))
    write_csv(
        {n: list(v) if n in _TEXTS else np.array(v, np.float64) for n, v in columns.items()}, path
    )


def _measured(r: StopRecord, offsets: dict[str, float]) -> tuple[float, ...]:
    time_offset = offsets.get(r.samples.terrain, offsets[""])
    return (
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
