"""Files that a terrain job can write: its events, the model, classes and signatures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.terrain.adaptation import classes_of
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.signature_fit import fit
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.files import fault
from slopewise.services.io.signature_file import write_signatures
from slopewise.services.io.terrain_file import write_terrains
from slopewise.services.io.terrain_table import event_row, excluded_row, write_terrain_table
from slopewise.services.jobs.plural import plural
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
    """Rows of the classified stretches of a run."""
    return [
        event_row(run.run, event, centres)
        for event, centres in zip(run.classified, run.centres, strict=True)
    ]


def updated_model(result: TerrainResult) -> Model:
    """The model on the ground driven now, with a table of braking for each class met.

    Raises:
        InputError: a class with a resistance at which the brakes would not stop the vehicle.
    """
    model = model_on(result.model, result.known, valid=result.ends_on_known_class)
    reference = result.model.terrain.motion_resistance
    for name, values in result.class_values.items():
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
    """Write the classes learned from the log's labels, else by adaptation; and signatures.

    Returns:
        A note on the signatures, or on why they are missing; "" without labels.
    """
    learned, note, signatures = result.classes, "", ""
    values, labels = zip(*result.labelled, strict=True) if result.labelled else ((), ())
    if any(labels):
        known = np.array([event.observation.known.values for event in values])
        learned = classes_of(result.terrains.name, labels, known)
    try:
        model = _fit_signatures(result)
    except ParameterError as error:
        note = f"no signatures learned: expected {error.expected}"
    else:
        if model is not None:
            file = path.with_suffix(".signatures.json")
            write_signatures(model, file)
            signatures = file.name
            note = (
                f"signatures of {plural(len(model.classes), 'class')} in {signatures}: "
                f"{model.known_refused:.1%} of held-out known ground was rejected as unknown"
            )
    terrains = replace(result.terrains, terrain=learned.terrain, signatures=signatures)
    write_terrains(terrains, path)
    return note


def _fit_signatures(result: TerrainResult) -> SignatureModel | None:
    """Signatures by the log's column terrain, None if it has none.

    Raises:
        ParameterError: too few runs of a class, or scikit-learn is not installed.
    """
    rows = [
        (signature, label, run.run)
        for run in result.runs
        for signature, label in run.signatures
        if label
    ]
    if not rows:
        return None
    signatures, labels, runs = zip(*rows, strict=True)
    return fit(signatures, labels, runs)
