"""What drive logs teach: a braking model, and what a model leaves out."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from slopewise.models.calibration.learn import Calibration, learn
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.parameters import Model
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.logs.log_source import grade_by_map, refuse_wrong_units


def calibrate(
    log: DriveLog,
    model: Model,
    *,
    map_file: str | PathLike[str] | None = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """Learn force, dead time and safety offset of the brakes from the stops of a drive log.

    ``dataclasses.replace(model, braking=calibration.braking)`` is the model with what was learned.

    Args:
        log: with stops in it.
        model: the one so far; it decides only what the log says nothing about.
        map_file: elevation map that the log's x, y lie on; without it the grade comes from the
            pitch of the body.
        settings: share of future stops to cover, and what counts as a stop.

    Raises:
        InputError: a channel is in another unit; names file and column.
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """
    refuse_wrong_units(log)
    ground = grade_by_map(log, None if map_file is None else Path(map_file), model.vehicle)
    return learn(
        log.columns, log.runs, model.braking, ground=ground, settings=settings, beside=model
    )


def find_discrepancies(
    log: DriveLog,
    model: Model,
    *,
    map_file: str | PathLike[str] | None = None,
    settings: DiscrepancySettings | None = None,
    source: str = "",
) -> Findings:
    """Where a model and a drive log disagree, which effect is missing, and the model with it.

    Args:
        log: with stops in it; further numeric columns are candidate explanations.
        model: as configured.
        map_file: elevation map that the log's x, y lie on.
        settings: how sure to be.
        source: of the log, written into the effects that are added.

    Raises:
        ParameterError: too few usable stops.
    """
    ground = grade_by_map(log, None if map_file is None else Path(map_file), model.vehicle)
    return investigate(
        log.columns, log.runs, model, ground=ground, settings=settings, source=source
    )
