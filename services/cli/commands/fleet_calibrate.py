"""`slopewise fleet calibrate`: a model file for each vehicle out of the logs of all."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from slopewise.models.calibration.fleet import FleetCalibration, VehicleStops, learn_fleet
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.cli.arguments.fleet import FleetCalibrateOptions
from slopewise.services.cli.screen import progress_bar
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.fleet.vehicle_logs import LogTask, measure_vehicle, vehicles_of
from slopewise.services.io.files import fault, reason
from slopewise.services.io.model_file import find_model, model_to_dict, read_model, write_model
from slopewise.services.io.no_data import nodata_of

_LISTED = 30


@dataclass(frozen=True, slots=True)
class FleetCalibrateResult:
    """What was learned, from which stops."""

    calibration: FleetCalibration
    model: Model
    vehicles: list[VehicleStops]
    seconds: float


def run(job: FleetCalibrateOptions, *, quiet: bool = False) -> FleetCalibrateResult:
    """Measure the stops of each vehicle, fit them together, write the model files.

    Raises:
        InputError: names file and field, or says why there are too few stops.
    """
    begin = time.perf_counter()
    check_installed()
    try:
        settings = CalibrationSettings(coverage=job.coverage)
    except ParameterError as error:
        raise fault("--coverage", "", f"expected {error.expected}") from None
    model = read_model(find_model(job.model))
    grouped = vehicles_of(job.logs, job.by_folder)
    _make(job.out)
    map_file = None if job.map_file is None else job.map_file.resolve()
    nodata = nodata_of(job.nodata)
    tasks: list[Task[LogTask]] = [
        (
            name,
            LogTask(name, tuple(p.resolve() for p in logs), model_to_dict(model), map_file, nodata),
        )
        for name, logs in grouped.items()
    ]
    found: dict[str, VehicleStops] = {}
    with progress_bar("measuring stops", len(tasks), quiet=quiet) as advance:
        for stops in each_done(measure_vehicle, tasks, Workers(job.workers, job.scheduler)):
            found[stops.name] = stops
            advance(1)
    vehicles = [found[name] for name in grouped]  # in the order given, whoever was done first
    try:
        learned = learn_fleet(vehicles, model.braking, settings)
    except ParameterError as error:
        raise fault("fleet", error.field, f"expected {error.expected}") from None
    for name, braking in learned.braking.items():
        write_model(replace(model, name=name, braking=braking), job.out / f"{name}.toml")
    return FleetCalibrateResult(learned, model, vehicles, time.perf_counter() - begin)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise fault(folder, "", f"expected a folder to write to, got: {reason(error)}") from None


def as_json(result: FleetCalibrateResult) -> dict[str, Any]:
    """Everything for machines, SI units and radians."""
    c = result.calibration
    return {
        "surfaces": {
            name: {
                "mean": dict(zip(NAMES, fit.mean.tolist(), strict=True)),
                "spread": fit.spread.tolist(),
                "scatter": fit.scatter,
                "stops": len(fit.kept),
                "kept": int(fit.kept.sum()),
            }
            for name, fit in c.surfaces.items()
        },
        "dead_time": {
            "mean": c.dead_time.value,
            "std": c.dead_time.std,
            "spread": c.dead_time.between_stops,
        },
        "vehicles": {
            v.name: {
                "stops": len(v.stops),
                "note": v.note,
                "dead_time": c.braking[v.name].dead_time,
                "distance_offset": c.braking[v.name].distance_offset,
                **{name: getattr(c.braking[v.name], name) for name in NAMES},
            }
            for v in result.vehicles
        },
        "seconds": result.seconds,
    }


def show(result: FleetCalibrateResult, console: Console) -> None:
    """The fleet, then its vehicles."""
    c = result.calibration
    table = Table(title=f"fleet of {len(result.vehicles)} {result.model.name}", box=box.SIMPLE_HEAD)
    table.add_column("mean ± from vehicle to vehicle")
    for name in c.surfaces:
        table.add_column(name or "base", justify="right")
    for k, name in enumerate(NAMES):
        cells = (f"{f.mean[k]:.4f} ± {np.sqrt(f.spread[k, k]):.4f}" for f in c.surfaces.values())
        table.add_row(name, *cells)
    table.add_row("stop to stop", *(f"{f.scatter:.4f}" for f in c.surfaces.values()))
    kept = (f"{int(f.kept.sum())} of {len(f.kept)}" for f in c.surfaces.values())
    table.add_row("stops learned from", *kept)
    console.print(table)
    console.print(f"dead time {c.dead_time.value:.3f} ± {c.dead_time.between_stops:.3f} s")
    each = Table(box=box.SIMPLE_HEAD)
    for title in ("vehicle", "stops", *NAMES, "dead time\ns", "offset\nm"):
        each.add_column(title, justify="left" if title == "vehicle" else "right")
    for v in result.vehicles[:_LISTED]:
        b = c.braking[v.name]
        numbers = (f"{getattr(b, name):.4f}" for name in NAMES)
        late, offset = f"{b.dead_time:.3f}", f"{b.distance_offset:.3f}"
        each.add_row(v.name, str(len(v.stops)), *numbers, late, offset)
    console.print(each)
    if len(result.vehicles) > _LISTED:
        console.print(f"… and {len(result.vehicles) - _LISTED} more; --json gives all")
    for v in result.vehicles:
        if v.note:
            console.print(f"note: {v.name} gets the fleet's mean: {v.note}", style="yellow")
