"""What a worker does with the logs of one vehicle: hold them against its model, write the answer.

What comes back is one row; samples and files stay where the work was done. A log that cannot be
used costs the fleet one row and nothing else.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from slopewise.models.errors import SlopewiseError
from slopewise.services.fleet import finding
from slopewise.services.fleet.finding import FAILED, REFUSED, Row
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
        model_file, begun: shown on its page. source: written into effects that are found.
        key: of all that the answer depends on. folder: that all workers write to.
        map_file, topics, settings, nodata: as `slopewise discrepancy` has them. page: draw one.
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
        return Path(self.folder) / finding.VEHICLES / self.vehicle

    @property
    def files(self) -> list[Path]:
        """That a finished vehicle has."""
        names = [findings_file.FINDINGS, findings_file.MODEL]
        return [self.own_folder / name for name in (names + [findings_file.PAGE] * self.page)]


def investigate_vehicle(task: VehicleTask) -> Row:
    """Look at one vehicle, write its files, then its row.

    Raises:
        InputError: the folder cannot be written to.
    """
    try:
        row = _looked_at(task)
    except SlopewiseError as error:
        row = _without(task, REFUSED, " ".join(str(error).split()))
    except _BROKEN as error:
        words = f"fault of slopewise, not of the log: {type(error).__name__}: {error}"
        row = _without(task, FAILED, words)
    finding.write(Path(task.folder), row)
    return row


def given_up(task: VehicleTask) -> Row:
    """The row of a vehicle whose logs ended several workers."""
    words = (
        "its workers ended without an answer; most likely its logs need more memory than one has"
    )
    row = _without(task, FAILED, words)
    finding.write(Path(task.folder), row)
    return row


def finished(task: VehicleTask) -> Row | None:
    """The row of an earlier run, if that came to an end and answers the same question."""
    row = finding.read(Path(task.folder), task.vehicle, task.key)
    if row is None or row["status"] == FAILED:
        return None
    whole = row["status"] == REFUSED or all(file.is_file() for file in task.files)
    return row if whole else None


def _without(task: VehicleTask, status: str, reason: str) -> Row:
    # An answer of yesterday's log would be taken for one of today's.
    for file in task.files:
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)
    return finding.without_answer(task.vehicle, task.key, status, reason)


def _looked_at(task: VehicleTask) -> Row:
    model = model_from_dict(task.model, "model")
    log = read_logs(task.logs, task.topics)
    ground = grade_by_map(log, task.map_file, model.vehicle, task.nodata)
    findings, evidence = investigate_with_evidence(
        log.columns, log.runs, model, ground=ground, settings=task.settings, source=task.source
    )
    findings = replace(findings, model=replace(findings.model, name=task.vehicle))
    findings_file.write_findings(findings, task.own_folder)
    if task.page:
        from slopewise.services.report.discrepancy_page import write_report

        provenance = {
            "logs": ", ".join(log.name for log in task.logs),
            "model so far": task.model_file,
            "begun": task.begun,
        }
        write_report(
            task.own_folder / findings_file.PAGE,
            findings,
            evidence,
            title=f"{task.vehicle} against its log",
            provenance=provenance,
        )
    told = findings_file.findings_as_json(findings)
    return finding.answered(task.vehicle, task.key, told)
