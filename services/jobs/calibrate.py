"""Calibrate the braking model of a vehicle from the stops of its drive logs."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import Calibration, learn, with_learned
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.calibration.tracking_fit import TrackingFit, fit_tracking
from slopewise.models.calibration.tracking_samples import tracking_samples
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.models.plausibility import check_plausible
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, find_stops
from slopewise.models.stop_logs.held_values import fresh_samples
from slopewise.services.io.decode import decode_table
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault, read_toml
from slopewise.services.io.log_checks import (
    refuse_ramps,
    refuse_too_fast,
    refuse_unit,
    refuse_wrong_units,
    unseen_channels,
)
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import from_options


@dataclass(frozen=True, slots=True)
class CalibrateResult:
    """A calibration, the model with what was learned, and the log."""

    calibration: Calibration
    model: Model
    log: DriveLog
    seconds: float
    tracking: TrackingFit | None = None  # None where the log has no poses with a path


class RejectedLogError(InputError):
    """A log that calibration rejects, with its stops and data issues."""

    def __init__(self, error: InputError, log: DriveLog, settings: StopSettings) -> None:
        super().__init__(error.source, error.field, error.expected)
        self.log = log
        self.suspects: tuple[Suspect, ...] = find_suspects(log.columns, log.runs)
        usable_samples = usable(len(log.columns["t"]), self.suspects, ["v", "v_cmd"])
        fresh = fresh_samples(log.columns, log.runs)
        self.windows: list[StopWindow] = [
            window
            for run in log.runs
            for window in find_stops(log.columns, run, usable_samples, settings, fresh)
        ]


def calibrate(logs: LogInput, model_file: str, *, settings: CalibrationSettings) -> CalibrateResult:
    """Read logs, find stops and fit; the prior is a model file or the name of a shipped vehicle."""
    begin = time.perf_counter()
    model = read_model(find_model(model_file))
    with progress_bar("calibrating", 4) as advance:
        log = logs.read()
        advance(1)
        try:
            refuse_wrong_units(log)
            refuse_too_fast(log, model)
            ground = logs.grade(log, model.vehicle)
            advance(1)
            calibration = calibrate_log(log, model, ground, settings)
            grades = np.array([r.grade for s in calibration.surfaces for r in s.records])
            refuse_unit(calibration.braking, model.braking, grades, logs.names)
            refuse_ramps(calibration.braking, logs.names)
            updated = with_learned(model, calibration)
            check_plausible(model_to_dict(updated))  # as any reader of its file does
            advance(2)
        except (InputError, ParameterError) as error:
            if isinstance(error, ParameterError):
                expected = logs.in_own_units(f"expected {error.expected}")
                error = fault(logs.names, error.field, expected)
            raise RejectedLogError(error, log, settings.stops) from None
    tracking = None
    if (samples := tracking_samples(log.columns, log.runs)) is not None:
        tracking = fit_tracking(samples, model.tracking, model.limits.speed, settings.coverage)
        updated = replace(updated, tracking=tracking.tracking)
        calibration = replace(calibration, warnings=(*calibration.warnings, tracking.note))
    missing = unseen_channels(model.effect, log.columns)
    warnings = map(logs.in_own_units, (*log.notes, *calibration.warnings, *missing))
    calibration = replace(calibration, warnings=tuple(warnings))
    return CalibrateResult(calibration, updated, log, time.perf_counter() - begin, tracking)


def calibrate_log(
    log: DriveLog,
    model: Model,
    ground: Floats | None = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """Fit the stops of a log that is in memory; ground: grade at each sample [rad].

    ParameterError: too few usable stops.
    """
    return learn(
        log.columns, log.runs, model.braking, ground=ground, settings=settings, effects_model=model
    )


def calibration_settings(coverage: float, stop_settings: Path | None = None) -> CalibrationSettings:
    """Settings from the option, and from a TOML file with keys of :class:`.StopSettings`."""
    stops = StopSettings(partial=True)
    if stop_settings is not None:
        data = {"partial": True} | read_toml(stop_settings)
        stops = decode_table(StopSettings, data, str(stop_settings))
    return from_options(CalibrationSettings, coverage=coverage, stops=stops)
