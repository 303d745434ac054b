"""Files that a terrain job can write: its events, the model, and classes with thresholds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.terrain.learn import classes_of, thresholds_of
from slopewise.models.terrain.observation import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.files import fault
from slopewise.services.io.terrain_file import write_terrains
from slopewise.services.io.terrain_table import event_row, excluded_row, write_terrain_table
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult


def write_events(result: TerrainResult, path: Path) -> None:
    """Write one row per stretch, change or excluded part, in chronological order."""
    time = result.log.columns["t"]
    table: list[dict[str, Any]] = []
    for run in result.runs:
        rows = [event_row(run.run, event) for event in run.changes]
        rows += stretch_rows(run)
        rows += [excluded_row(run.run, time, stretch) for stretch in run.excluded]
        table += sorted(rows, key=lambda row: float(row["t"]))
    write_terrain_table(table, path)


def stretch_rows(run: RunEvents) -> list[dict[str, Any]]:
    """Rows of the stretches of a run."""
    return [
        event_row(run.run, event, centres)
        for event, centres in zip(run.stretches, run.centres, strict=True)
    ]


def updated_model(result: TerrainResult) -> Model:
    """The model on the ground driven now, with a table of braking for each ground with a name.

    Raises:
        InputError: a ground with a resistance at which the brakes would not stop the vehicle.
    """
    model = model_on(result.model, result.known, valid=result.is_relied_on)
    reference = result.model.terrain.motion_resistance
    for name, values in result.values_by_name.items():
        f_r = np.array(values)[:, 0]
        f_r = f_r[np.isfinite(f_r)]
        if len(f_r) < 2:
            continue
        estimate = TerrainEstimate(float(np.mean(f_r)), float(np.std(f_r, ddof=1)))
        try:
            model = with_surface(model, name, estimate, reference)
        except ParameterError as error:
            raise fault(result.model.name, error.field, f"{name}: {error.expected}") from None
    return model


def write_learned(result: TerrainResult, path: Path) -> str:
    """Write classes and thresholds learned from the log's column terrain; a note on their days.

    Raises:
        InputError: the log does not name its ground.
    """
    runs = result.labelled
    if not runs:
        source = str(result.log.sources[0])
        raise fault(source, "column terrain", "expected names of the ground to learn from")
    classes = classes_of(result.terrains.name, runs)
    vehicle = result.model.vehicle
    lever = vehicle.track_width / vehicle.wheelbase
    thresholds = thresholds_of(classes, lever, result.terrains.thresholds)
    learned = replace(result.terrains, terrain=classes.terrain, thresholds=thresholds)
    write_terrains(learned, path)
    days = ", ".join(f"{terrain.name} {terrain.days:g}" for terrain in classes.terrain)
    return f"days or sites in {path.name}: {days}; a single name needs three (column session)"
