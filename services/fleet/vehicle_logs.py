"""Logs of each vehicle, and the task of a worker: find and measure their stops.

Only the stops are returned; samples stay with the worker.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slopewise.models.calibration.effects_in_force import measured_beside
from slopewise.models.calibration.fleet import FEWEST, VehicleStops, vehicle_stops
from slopewise.models.calibration.learn import measure_log
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.measured_log import is_mapped
from slopewise.services.io.drive_log import read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.log_checks import refuse_wrong_units
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.io.no_data import NoData
from slopewise.services.io.track_grade import grade_by_map


def vehicles_of(logs: Sequence[Path], by_folder: bool) -> dict[str, list[Path]]:
    """Logs of each vehicle, in the order given.

    Args:
        logs: drive logs of all vehicles. by_folder: a folder is a vehicle; else each file is one.
    """
    grouped: dict[str, list[Path]] = {}
    for log in logs:
        name = log.resolve().parent.name if by_folder else log.stem
        logs_of_name = grouped.setdefault(name, [])
        first = logs_of_name[0] if logs_of_name else None
        if first and (not by_folder or first.resolve().parent != log.resolve().parent):
            message = f"expected a unique name of the vehicle, got another {name} in {first}"
            hint = "" if by_folder else "; --by-folder takes the logs of a folder together"
            raise fault(log, "", message + hint)
        logs_of_name.append(log)
    return grouped


@dataclass(frozen=True, slots=True)
class LogTask:
    """Logs of one vehicle, the model so far as tables, and a map if there is one."""

    vehicle: str
    logs: tuple[Path, ...]
    model: dict[str, Any]
    map_file: Path | None
    nodata: NoData = None


def measure_vehicle(task: LogTask) -> VehicleStops:
    """Measure its stops; none, with the reason, where there are too few."""
    model = model_from_dict(task.model, "model")
    log = read_logs(task.logs)
    refuse_wrong_units(log)
    ground = grade_by_map(log, task.map_file, model.vehicle, task.nodata)
    try:
        measured = measure_log(log.columns, log.runs, model.braking, ground=ground, fewest=FEWEST)
    except ParameterError as error:
        return VehicleStops(task.vehicle, note=f"{error.field}: expected {error.expected}")
    compensated = measured_beside(measured.measured, model, log.columns)
    measured = dataclasses.replace(measured, measured=compensated)
    return vehicle_stops(task.vehicle, measured, is_mapped(ground))
