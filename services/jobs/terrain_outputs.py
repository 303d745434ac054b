"""Files that a terrain job can write: its events, the model, and classes with thresholds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.terrain.agreement import ALPHA
from slopewise.models.terrain.description import GroundChange
from slopewise.models.terrain.learn import classes_of, thresholds_of
from slopewise.models.terrain.monitor import DescribedStretch
from slopewise.models.terrain.observation import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.files import fault
from slopewise.services.io.table import write_rows
from slopewise.services.io.terrain_file import write_terrains
from slopewise.services.jobs.terrain_result import LoggedStretch, TerrainResult

_MEASURED = ("samples", "speed", "speed_difference", "yaw_rate", "onset_current")
_ESTIMATED = ("motion_resistance", "lateral_resistance", "slip_track")
_TEXT = ("run", "phase", "hardness", "grip", "agrees_with", "terrain", "rules", "note")
COLUMNS = (
    "run",
    "t",
    "t_end",
    "phase",
    *_MEASURED,
    *(f"{name}{end}" for name in _ESTIMATED for end in ("", "_std")),
    "turning_thrust",
    "turning_thrust_std",
    "hardness",
    "grip",
    "agrees_with",
    "terrain",
    "probability",
    "rules",
    "centre_left",
    "centre_right",
    "change",
    "note",
)


def write_events(result: TerrainResult, path: Path) -> None:
    """Write one row per stretch, change or excluded part, in chronological order of each run."""
    t = result.log.columns["t"]
    rows: list[dict[str, Any]] = []
    for run in result.runs:
        of_run = [_change_row(run.run, change) for change in run.changes]
        of_run += [stretch_row(run.run, stretch) for stretch in run.stretches]
        of_run += [_excluded_row(run.run, t, stretch) for stretch in run.excluded]
        rows += sorted(of_run, key=lambda row: float(row["t"]))
    write_rows(rows, COLUMNS, _TEXT, path)


def _change_row(run: str, change: GroundChange) -> dict[str, Any]:
    again = ", again within ten seconds" if change.again else ""
    return {
        "run": run,
        "t": change.time,
        "t_end": change.time,
        "phase": "change",
        "change": change.strength,
        "note": f"the ground changed from {change.before} to {change.now}{again}",
    }


def _excluded_row(run: str, t: Floats, part: Suspect) -> dict[str, Any]:
    return {
        "run": run,
        "t": float(t[part.start]),
        "t_end": float(t[min(part.stop, len(t)) - 1]),
        "phase": "excluded",
        "samples": part.stop - part.start,
        "note": part.reason,
    }


def stretch_row(run: str, event: LoggedStretch) -> dict[str, Any]:
    """Columns of a stretch of a run; parameters are the estimates when it ends."""
    o = event.observation
    row = {
        "run": run,
        "t": o.begin,
        "t_end": o.end,
        "phase": o.phase.value,
        **{name: getattr(o, name) for name in _MEASURED},
        "hardness": event.description.hardness,
        "grip": event.description.grip,
        "agrees_with": " ".join(event.agrees_with),
        "terrain": event.name,
        "probability": 1.0 - ALPHA if event.name else np.nan,
        "rules": event.rules,
        "note": _note(event),
        "centre_left": event.centres[0],
        "centre_right": event.centres[1],
        "turning_thrust": o.turning.value,
        "turning_thrust_std": o.turning.std,
    }
    for name in _ESTIMATED:
        estimate = getattr(o.known, name)
        row[name], row[f"{name}_std"] = estimate.value, estimate.std
    return row


def _note(event: DescribedStretch) -> str:
    estimates = event.observation.measured
    notes = [estimates.motion_resistance.note, estimates.lateral_resistance.note]
    if event.is_stuck:
        notes.append("wheels spin: nothing is learned")
    return "; ".join(note for note in notes if note)


def updated_model(result: TerrainResult) -> Model:
    """The model on the ground driven now, with a table of braking for each ground with a name.

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
    """Write classes and thresholds learned from the log's column terrain; a note on their days."""
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
