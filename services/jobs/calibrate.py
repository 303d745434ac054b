"""Calibrate the braking model of a vehicle from the stops of its drive logs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import Calibration, learn, with_learned
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, find_stops
from slopewise.services.io.columns import in_own_units, parse_names
from slopewise.services.io.decode import decode_table
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.files import fault, read_toml
from slopewise.services.io.logs.log_source import grade_by_map, names_of, refuse_wrong_units
from slopewise.services.io.logs.speed_unit import refuse_too_fast, refuse_unit
from slopewise.services.io.logs.unseen_channels import unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import option_of


@dataclass(frozen=True, slots=True)
class CalibrateResult:
    """The calibration, the model with it, and its log."""

    calibration: Calibration
    model: Model
    log: DriveLog
    seconds: float


class RejectedLogError(InputError):
    """A log that calibration rejects, with its stops and data issues."""

    def __init__(self, error: InputError, log: DriveLog, settings: StopSettings) -> None:
        super().__init__(error.source, error.field, error.expected)
        self.log = log
        self.suspects: tuple[Suspect, ...] = find_suspects(log.columns, log.runs)
        usable_samples = usable(len(log.columns["t"]), self.suspects, ["v", "v_cmd"])
        self.windows: list[StopWindow] = [
            window
            for run in log.runs
            for window in find_stops(log.columns, run, usable_samples, settings)
        ]


def calibrate(
    logs: Sequence[Path],
    model_file: str,
    *,
    settings: CalibrationSettings,
    map_file: Path | None = None,
    nodata: NoData = None,
    topics: Path | None = None,
    columns: str = "",
    quiet: bool = True,
) -> CalibrateResult:
    """Read logs, find stops, fit.

    Args:
        logs: tables or recordings.
        model_file: model file or shipped vehicle, the prior.
        settings: share of stops to cover, and what is a stop.
        map_file: elevation map that x, y of the logs lie on.
        nodata: height of the map that marks unknown ground [m].
        topics: topic mapping of recordings.
        columns: names and units of tables that differ.
        quiet: without a progress bar.

    Raises:
        InputError: names file and field, or says why there are too few stops.
    """
    begin = time.perf_counter()
    model = read_model(find_model(model_file))
    with progress_bar("calibrating", 4, quiet=quiet) as advance:
        log = read_logs(logs, topics, columns)
        advance(1)
        try:
            refuse_wrong_units(log)
            refuse_too_fast(log, model)
            ground = grade_by_map(log, map_file, model.vehicle, nodata)
            advance(1)
            calibration = _fit(log, model, ground, settings, names_of(logs))
            updated = with_learned(model, calibration)
            advance(2)
        except (InputError, ParameterError) as error:
            if isinstance(error, ParameterError):
                expected = in_own_units(f"expected {error.expected}", parse_names(columns))
                error = fault(names_of(logs), error.field, expected)
            raise RejectedLogError(error, log, settings.stops) from None
    warnings = (*log.notes, *calibration.warnings)
    own = tuple(in_own_units(sentence, parse_names(columns)) for sentence in warnings)
    calibration = replace(calibration, warnings=own)
    return CalibrateResult(calibration, updated, log, time.perf_counter() - begin)


def _fit(
    log: DriveLog, model: Model, ground: Floats | None, settings: CalibrationSettings, source: str
) -> Calibration:
    calibration = calibrate_log(log, model, ground, settings)
    grades = np.array([r.grade for s in calibration.surfaces for r in s.records])
    refuse_unit(calibration.braking, model.braking, grades, source)
    missing = unseen_channels(model.effect, log.columns)
    return replace(calibration, warnings=(*calibration.warnings, *missing))


def calibrate_log(
    log: DriveLog,
    model: Model,
    ground: Floats | None = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """Fit the stops of a log that is in memory.

    Args:
        log: with stops in it.
        model: the prior.
        ground: grade of the ground at each sample [rad], None without a map.
        settings: share of stops to cover, and what is a stop.

    Raises:
        ParameterError: too few usable stops.
    """
    return learn(
        log.columns, log.runs, model.braking, ground=ground, settings=settings, beside=model
    )


def calibration_settings(
    coverage: float,
    *,
    stop_settings: Path | None = None,
    least_speed: float | None = None,  # words: ok, key of stop settings
    turn_rate: float | None = None,
) -> CalibrationSettings:
    """Settings from options, and from a file on what is a stop.

    Args:
        coverage: share of stops like those of the log that margins have to cover.
        stop_settings: TOML file with keys of :class:`.StopSettings`.
        least_speed: stops from below this speed are ignored [m/s].
        turn_rate: mean yaw rate from which a stop is a turn [rad/s].

    Raises:
        InputError: names option, or file and key.
    """
    stops = StopSettings(partial=True)
    if stop_settings is not None:
        data = {"partial": True} | read_toml(stop_settings)
        stops = decode_table(StopSettings, data, str(stop_settings))
    try:
        if least_speed is not None:
            stops = replace(stops, least_speed=least_speed)
        if turn_rate is not None:
            stops = replace(stops, turn_rate=turn_rate)
        return CalibrationSettings(coverage=coverage, stops=stops)
    except ParameterError as error:
        if error.field in ("coverage", "least_speed", "turn_rate"):
            raise fault(option_of(error.field), "", f"expected {error.expected}") from None
        where = "--least-speed" if stop_settings is None else stop_settings
        raise fault(where, error.field, f"expected {error.expected}") from None
