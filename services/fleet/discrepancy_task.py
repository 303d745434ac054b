"""Task of a worker: compare the logs of one vehicle with its model, write files and one row.

Samples and files stay with the worker. A log that cannot be used costs the fleet one row only.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from slopewise.models.errors import SlopewiseError
from slopewise.services.fleet import finding_row
from slopewise.services.fleet.finding_row import FAILED, REFUSED, Row
from slopewise.services.io import findings_file
from slopewise.services.io.drive_log import read_logs
from slopewise.services.io.logs.log_source import grade_by_map
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.io.no_data import NoData

_BROKEN = (ArithmeticError, LookupError, MemoryError, RuntimeError, TypeError, ValueError)
"""A fault of the program in one vehicle's numbers must not end the work on all others."""


@dataclass(frozen=True, slots=True)
class VehicleTask:
    """One vehicle; plain values, so that it travels.

    Attributes:
        vehicle: its name. logs: its drive logs. model: tables of its model file.
        model_file, begun: shown on its page. source: provenance of effects that are found.
        key: digest of all inputs. folder: shared by all workers.
        map_file, topics, settings, nodata: as in `slopewise discrepancy`. page: draw one.
    """

    vehicle: str
    logs: tuple[Path, ...]
    model: dict[str, Any]
    model_file: str
    begun: str
    source: str
    key: str
    folder: str
    map_file: Path | None = None
    topics: Path | None = None
    settings: DiscrepancySettings | None = None
    page: bool = True
    nodata: NoData = None

    @property
    def own_folder(self) -> Path:
        """Where its files go."""
        return Path(self.folder) / finding_row.VEHICLES / self.vehicle

    @property
    def files(self) -> list[Path]:
        """That a finished vehicle has."""
        names = [findings_file.FINDINGS, findings_file.MODEL]
        return [self.own_folder / name for name in (names + [findings_file.PAGE] * self.page)]


def investigate_vehicle(task: VehicleTask) -> Row:
    """Examine one vehicle, write its files, then its row."""
    try:
        row = _examine(task)
    except SlopewiseError as error:
        row = _without(task, REFUSED, " ".join(str(error).split()))
    except _BROKEN as error:
        message = f"fault of slopewise, not of the log: {type(error).__name__}: {error}"
        row = _without(task, FAILED, message)
    finding_row.write(Path(task.folder), row)
    return row


def failed_row(task: VehicleTask) -> Row:
    """Row of a vehicle whose logs ended several workers, written."""
    message = (
        "its workers ended without an answer; most likely its logs need more memory than one has"
    )
    row = _without(task, FAILED, message)
    finding_row.write(Path(task.folder), row)
    return row


def finished(task: VehicleTask) -> Row | None:
    """Row of an earlier run of the same task, if it is complete."""
    row = finding_row.read(Path(task.folder), task.vehicle, task.key)
    if row is None or row["status"] == FAILED:
        return None
    is_complete = row["status"] == REFUSED or all(file.is_file() for file in task.files)
    return row if is_complete else None


def _without(task: VehicleTask, status: str, reason: str) -> Row:
    # Files of an earlier log would pass for results of this one.
    for file in task.files:
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)
    return finding_row.failed_finding(task.vehicle, task.key, status, reason)


def _examine(task: VehicleTask) -> Row:
    model = model_from_dict(task.model, "model")
    log = read_logs(task.logs, task.topics)
    ground = grade_by_map(log, task.map_file, model.vehicle, task.nodata)
    findings, evidence = investigate_with_evidence(
        log.columns, log.runs, model, ground=ground, settings=task.settings, source=task.source
    )
    findings = replace(findings, model=replace(findings.model, name=task.vehicle))
    findings_file.write_findings(findings, task.own_folder)
    if task.page:
        from slopewise.services.report.discrepancy_page import write_discrepancy_page

        provenance = {
            "logs": ", ".join(log.name for log in task.logs),
            "model so far": task.model_file,
            "begun": task.begun,
        }
        write_discrepancy_page(
            task.own_folder / findings_file.PAGE,
            findings,
            evidence,
            title=f"{task.vehicle} against its log",
            provenance=provenance,
        )
    result = findings_file.findings_as_json(findings)
    return finding_row.finding_row(task.vehicle, task.key, result)
