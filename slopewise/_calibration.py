"""A braking model from a drive log, and the effects that a model lacks."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import Calibration
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.parameters import Model
from slopewise.models.typed_arguments import typed_arguments
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.log_checks import refuse_wrong_units
from slopewise.services.io.track_grade import grade_by_map
from slopewise.services.jobs.calibrate import calibrate_log


@typed_arguments
def calibrate(
    log: DriveLog,
    model: Model,
    *,
    map_file: str | PathLike[str] | None = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """Fit force, dead time and safety offset of the brakes to the stops of a drive log.

    ``dataclasses.replace(model, braking=calibration.braking)`` is the model with the fit.

    Args:
        log: drive log with stops in it.
        model: the prior; it decides only what the log carries no information on.
        map_file: elevation map that the log's x, y lie on; without it the grade comes from the
            pitch of the body.
        settings: share of future stops to cover, and what is a stop.

    Raises:
        InputError: a channel is in another unit; names file and column.
        ParameterError: too few usable stops; with their number and the reasons.
    """
    refuse_wrong_units(log)
    return calibrate_log(log, model, _ground(log, model, map_file), settings)


@typed_arguments
def find_discrepancies(
    log: DriveLog,
    model: Model,
    *,
    map_file: str | PathLike[str] | None = None,
    settings: DiscrepancySettings | None = None,
    source: str = "",
) -> Findings:
    """Find where a model and a drive log disagree, the missing effect, and the model with it.

    Args:
        log: drive log with stops in it; further numeric columns are candidate explanations.
        model: as configured.
        map_file: elevation map that the log's x, y lie on.
        settings: rate of false alarms, and sizes that matter.
        source: name of the log, written into the effects that are added.

    Raises:
        ParameterError: too few usable stops.
    """
    ground = _ground(log, model, map_file)
    return investigate(
        log.columns, log.runs, model, ground=ground, settings=settings, source=source
    )


def _ground(log: DriveLog, model: Model, map_file: str | PathLike[str] | None) -> Floats | None:
    """Grade of the ground at each sample [rad], None without a map."""
    return None if map_file is None else grade_by_map(log, Path(map_file), model.vehicle)
