"""Task of a worker: compare the logs of one vehicle with its model, write files and one row.

Samples and files stay with the worker. A log that cannot be used costs the fleet one row only.
`findings/NAME.parquet` is written after the files in `vehicles/NAME/`, all or nothing, and carries
the key of the task: logs, model, settings, version. It does not depend on the worker or on how long
it took, so the same task gives the same bytes.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.errors import SlopewiseError
from slopewise.services.fleet.result_folder import write_parquet
from slopewise.services.io import findings_file
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.report.discrepancy_page import write_discrepancy_page

DONE, REFUSED, FAILED = "done", "refused", "failed"
"""Status: examined; logs rejected, with the reason; or failed, and tried again by another run."""

FINDINGS, VEHICLES = "findings", "vehicles"

Row = dict[str, Any]

_GAPS = ("gap", "stop_distance")
_OF_GAP = ("before", "refit", "after", "noise_floor", "closed")

_BROKEN = (ArithmeticError, LookupError, MemoryError, RuntimeError, TypeError, ValueError)
"""A fault of the program in one vehicle's numbers must not end the work on all others."""


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyRequest:
    """Logs, models and options of a fleet's comparison."""

    logs: LogInput
    models: str  # model file or name for all vehicles, or a folder with NAME.toml for each
    out: Path
    by_folder: bool  # a folder is a vehicle; else each file is one
    settings: DiscrepancySettings
    workers: int | None = None
    scheduler: str = ""


@dataclass(frozen=True, slots=True)
class VehicleTask:
    """One vehicle; plain values, so that it travels."""

    vehicle: str
    logs: LogInput
    model: dict[str, Any]  # tables of its model file
    model_file: str
    begun: str  # date that its page shows
    source: str  # provenance of effects that are found
    key: str  # digest of all inputs
    settings: DiscrepancySettings
    out: Path  # folder of the results, as all workers find it

    @property
    def folder(self) -> Path:
        """Where its files go."""
        return self.out / VEHICLES / self.vehicle

    @property
    def files(self) -> list[Path]:
        """That an examined vehicle has."""
        names = (findings_file.FINDINGS, findings_file.MODEL, findings_file.PAGE)
        return [self.folder / name for name in names]

    @property
    def row_file(self) -> Path:
        """Its row, written last."""
        return self.out / FINDINGS / f"{self.vehicle}.parquet"


def investigate_vehicle(task: VehicleTask) -> None:
    """Examine one vehicle, write its files, then its row."""
    try:
        row = _examine(task)
    except SlopewiseError as error:
        row = _without(task, REFUSED, " ".join(str(error).split()))
    except _BROKEN as error:
        message = f"fault of slopewise, not of the log: {type(error).__name__}: {error}"
        row = _without(task, FAILED, message)
    write_row(task, row)


def write_failed_row(task: VehicleTask) -> None:
    """Write the row of a vehicle whose logs ended several workers."""
    reason = "most likely its logs need more memory than one has"
    write_row(task, _without(task, FAILED, f"its workers ended without an answer; {reason}"))


def _without(task: VehicleTask, status: str, reason: str) -> Row:
    # Files of an earlier log would pass for results of this one.
    for file in task.files:
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)
    return row_without_finding(task.vehicle, task.key, status, reason)


def row_without_finding(vehicle: str, key: str, status: str, reason: str) -> Row:
    """Row of a vehicle that could not be examined."""
    return {"vehicle": vehicle, "key": key, "status": status, "reason": reason}


def finished(task: VehicleTask) -> Row | None:
    """Row of an earlier run of the same task, if it is complete."""
    row = read_row(task)
    if row is None or row["status"] == FAILED:
        return None
    is_complete = row["status"] == REFUSED or all(file.is_file() for file in task.files)
    return row if is_complete else None


def _examine(task: VehicleTask) -> Row:
    model, settings = model_from_dict(task.model, "model"), task.settings
    log = task.logs.read_for(model)
    ground = task.logs.grade(log, model.vehicle)
    findings = investigate(
        log.columns, log.runs, model, ground=ground, settings=settings, source=task.source
    )
    findings = replace(findings, model=replace(findings.model, name=task.vehicle))
    findings_file.write_findings(findings, task.folder)
    write_discrepancy_page(
        task.folder / findings_file.PAGE,
        findings,
        title=f"{task.vehicle} against its log",
        provenance={
            "logs": ", ".join(log.name for log in task.logs.files),
            "model so far": task.model_file,
            "begun": task.begun,
        },
    )
    return _finding_row(task, findings_file.findings_as_json(findings))


def _finding_row(task: VehicleTask, findings: dict[str, Any]) -> Row:
    effects = [
        effect | {"parameters": [{"name": n, **v} for n, v in effect["parameters"].items()]}
        for effect in findings["effects"]
    ]
    row = row_without_finding(task.vehicle, task.key, DONE, "") | {"effects": effects}
    row |= {name: findings[name] for name in ("verdict", "summary", "stops", "notes")}
    for gap in _GAPS:
        row |= {f"{gap}_{name}": findings[gap][name] for name in _OF_GAP}
    return row | {"next_experiment": findings["next_experiment"]["text"]}


def write_row(task: VehicleTask, row: Row) -> None:
    import pyarrow as pa

    text, number = pa.string(), pa.float64()
    parameter = pa.struct([("name", text), ("value", number), ("std", number), ("unit", text)])
    effect = pa.struct(
        [
            ("name", text),
            ("confidence", number),
            ("alternatives", pa.list_(text)),
            ("where", text),
            ("parameters", pa.list_(parameter)),
        ]
    )
    schema = pa.schema(
        [
            *((name, text) for name in ("vehicle", "key", "status", "reason", "verdict")),
            ("summary", text),
            ("stops", pa.int64()),
            ("effects", pa.list_(effect)),
            *((f"{gap}_{name}", number) for gap in _GAPS for name in _OF_GAP),
            ("notes", pa.list_(text)),
            ("next_experiment", text),
        ]
    )
    write_parquet(task.row_file, pa.Table.from_pylist([row], schema=schema))


def read_row(task: VehicleTask) -> Row | None:
    """Row of a vehicle if it is of this task; None also where it is damaged."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not task.row_file.is_file():
        return None
    try:
        row: Row = pq.ParquetFile(task.row_file).read().to_pylist()[0]
    except (pa.ArrowException, OSError, IndexError):
        return None
    return row if row.get("key") == task.key else None
