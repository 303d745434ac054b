"""Calibrate every vehicle of a fleet from the logs of all."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from slopewise.models.calibration.effects_in_force import net_of_effects
from slopewise.models.calibration.fleet import (
    MIN_VEHICLE_STOPS,
    FleetCalibration,
    VehicleStops,
    learn_fleet,
    vehicle_stops,
)
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learn import measure_log
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.models.plausibility import check_plausible
from slopewise.models.stop_logs.measured_log import is_mapped
from slopewise.services.fleet.result_folder import make_folder, vehicles_of
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.io.files import fault
from slopewise.services.io.log_checks import refuse_unit
from slopewise.services.io.model_file import (
    find_model,
    model_from_dict,
    model_to_dict,
    read_model,
    write_model,
)
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary, input_errors


@dataclass(frozen=True, slots=True)
class LogTask:
    """Logs of one vehicle, and the model so far as tables."""

    vehicle: str
    logs: LogInput
    model: dict[str, Any]


class UnusableLog(NamedTuple):
    """A vehicle whose log cannot be read, and why."""

    name: str
    reason: str


def measure_vehicle(task: LogTask) -> VehicleStops | UnusableLog:
    """Measure its stops; none, with the reason, where there are too few."""
    model = model_from_dict(task.model, "model")
    try:
        log = task.logs.read_for(model)
        ground = task.logs.grade(log, model.vehicle)
    except InputError as error:
        return UnusableLog(task.vehicle, str(error))
    try:
        measured = measure_log(
            log.columns, log.runs, model.braking, ground=ground, min_stops=MIN_VEHICLE_STOPS
        )
    except ParameterError as error:
        return VehicleStops(task.vehicle, note=f"{error.field}: expected {error.expected}")
    compensated = net_of_effects(measured.measured, model, log.columns)
    measured = replace(measured, measured=compensated)
    return vehicle_stops(task.vehicle, measured, is_mapped(ground))


class FleetSurface(Summary, frozen=True):
    """Coefficients of a fleet on one surface; `spread`: covariance from vehicle to vehicle."""

    mean: dict[str, float]
    spread: list[list[float]]
    scatter: float
    stops: int
    inliers: int = msgspec.field(name="kept")


class FleetCalibrationSummary(Summary, frozen=True):
    """Output of `fleet calibrate --json`."""

    surfaces: dict[str, FleetSurface]
    dead_time: dict[str, float]
    vehicles: dict[str, dict[str, Any]]
    seconds: float


@dataclass(frozen=True, slots=True)
class FleetCalibrateResult:
    """The calibration, the prior, the stops of each vehicle, and which got a model file."""

    calibration: FleetCalibration
    model: Model
    vehicles: list[VehicleStops]
    written: list[str]
    seconds: float

    @property
    def summary(self) -> FleetCalibrationSummary:
        """Everything that was fitted, SI units and radians."""
        c = self.calibration
        surfaces = {
            name: FleetSurface(
                dict(zip(NAMES, fit.mean.tolist(), strict=True)),
                fit.spread.tolist(),
                fit.scatter,
                len(fit.inliers),
                int(fit.inliers.sum()),
            )
            for name, fit in c.surfaces.items()
        }
        dead_time = {
            "mean": c.dead_time.value,
            "std": c.dead_time.std,
            "spread": c.dead_time.between_stops,
        }
        vehicles = {
            v.name: {
                "stops": len(v.stops),
                "note": "; ".join(filter(None, (v.note, *c.notes.get(v.name, ())))),
                "objections": c.objections.get(v.name, ()),
                "dead_time": c.braking[v.name].dead_time,
                "distance_offset": c.braking[v.name].distance_offset,
                **{name: getattr(c.braking[v.name], name) for name in NAMES},
            }
            for v in self.vehicles
        }
        for name in sorted(c.objections.keys() - vehicles.keys()):
            vehicles[name] = {"stops": 0, "objections": c.objections[name]}
        return FleetCalibrationSummary(surfaces, dead_time, vehicles, self.seconds)


def calibrate_fleet(
    logs: LogInput,
    model_file: str,
    out: Path,
    *,
    by_folder: bool = False,
    coverage: float = 0.995,
    workers: int | None = None,
    scheduler: str = "",
) -> FleetCalibrateResult:
    """Measure the stops of each vehicle, fit them together, write the model files.

    `by_folder`: a folder is a vehicle, else each file is one.
    """
    begin = time.perf_counter()
    check_installed()
    with input_errors("", ("coverage",)):
        settings = CalibrationSettings(coverage=coverage)
    model = read_model(find_model(model_file))
    grouped = vehicles_of(logs.files, by_folder)
    make_folder(out, out)
    tables = model_to_dict(model)
    tasks: list[Task[LogTask]] = [
        (name, LogTask(name, logs.resolved(files), tables)) for name, files in grouped.items()
    ]
    stops: dict[str, VehicleStops | UnusableLog] = {}
    with progress_bar("measuring stops", len(tasks)) as advance:
        for measured in each_done(measure_vehicle, tasks, Workers(workers, scheduler)):
            stops[measured.name] = measured
            advance(1)
    ordered = [stops[name] for name in grouped]  # as given
    vehicles = [v for v in ordered if isinstance(v, VehicleStops)]
    no_file = {v.name: v.reason for v in ordered if isinstance(v, UnusableLog)}
    try:
        calibration = learn_fleet(vehicles, model.braking, settings)
    except ParameterError as error:
        unusable = "".join(f"; {reason}" for reason in no_file.values())
        raise fault("fleet", error.field, f"expected {error.expected}{unusable}") from None
    for v in vehicles:
        grades = np.array([r.grade for r in v.stops])
        refuse_unit(calibration.braking[v.name], model.braking, grades, v.name)
    for name, braking in calibration.braking.items():
        fitted = replace(model, name=name, braking=braking)
        try:
            check_plausible(model_to_dict(fitted))
        except ParameterError as error:
            no_file[name] = f"{error.field}: expected {error.expected}"
            continue
        write_model(fitted, out / f"{name}.toml", calibration.objections.get(name, ()))
    for name, reason in no_file.items():
        objections = calibration.objections.get(name, ())
        calibration.objections[name] = (*objections, f"no model file: {reason}{_older(out, name)}")
    written = [v.name for v in ordered if v.name not in no_file]
    return FleetCalibrateResult(calibration, model, vehicles, written, time.perf_counter() - begin)


def _older(out: Path, name: str) -> str:
    """Note on a model file of a vehicle that an earlier run left, empty without one."""
    return f"; {name}.toml in {out} is of an earlier run" if (out / f"{name}.toml").exists() else ""
