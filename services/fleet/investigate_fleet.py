"""Compare the logs of many vehicles with their models, one by one, and count the effects."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.services.fleet import finding_row
from slopewise.services.fleet.discrepancy_task import (
    VehicleTask,
    failed_row,
    finished,
    investigate_vehicle,
)
from slopewise.services.fleet.finding_row import DONE, Row
from slopewise.services.fleet.fleet_summary import FleetSummary, summarise_fleet
from slopewise.services.fleet.parts import map_digest
from slopewise.services.fleet.result_folder import open_folder, remove_partial_files
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.fleet.vehicle_logs import vehicles_of
from slopewise.services.io.files import check_file, fault, read_text, write_atomic
from slopewise.services.io.findings_file import FINDINGS, source_of
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.jobs.progress import progress_bar

LINES, PAGE = "findings.jsonl", "report.html"  # One line per vehicle, and the page of the fleet
_FORMAT = 1  # Format of the results; those of another format are computed again


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyRequest:
    """Logs, models and options of a fleet's comparison.

    Attributes:
        models: model file or name for all vehicles, or a folder with NAME.toml for each.
        by_folder: a folder is a vehicle; else each file is one.
        map_file: elevation map that x, y of the logs lie on.
        nodata: height of the map that marks unknown ground [m].
    """

    logs: Sequence[Path]
    models: str
    out: Path
    by_folder: bool
    map_file: Path | None
    topics: Path | None
    settings: DiscrepancySettings
    workers: int | None = None
    scheduler: str = ""
    nodata: NoData = None


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyResult:
    """Rows of all vehicles in the order given, and their counts.

    Attributes:
        unexpected: vehicles in the folder that are not among these.
    """

    rows: list[Row]
    totals: FleetSummary
    resumed: int
    unexpected: int
    seconds: float

    @property
    def summary(self) -> dict[str, Any]:
        """Output of `fleet discrepancy --json`; findings.jsonl has the findings of each vehicle."""
        c = self.totals
        return {
            "vehicles": len(self.rows),
            "looked_at": c.examined,
            "verdicts": c.verdicts,
            "without_answer": c.failed,
            "effects": [
                {
                    "name": effect.name,
                    "vehicles": list(effect.vehicles),
                    "perhaps": list(effect.ambiguous_in),
                    "confidence": None if effect.confidence is None else list(effect.confidence),
                    "expected_right": effect.expected_true,
                    "parameters": {
                        name: {"unit": unit, "least": low, "median": median, "most": high}
                        for name, (unit, low, median, high) in effect.parameters.items()
                    },
                }
                for effect in c.effects
            ],
            "by_chance": c.expected_false,
            "resumed": self.resumed,
            "strays": self.unexpected,
            "seconds": self.seconds,
        }


def investigate_fleet(
    request: FleetDiscrepancyRequest, *, quiet: bool = True
) -> FleetDiscrepancyResult:
    """Examine the vehicles that no earlier run has examined, count all, write the lines."""
    begin = time.perf_counter()
    check_installed()
    grouped = vehicles_of(request.logs, request.by_folder)
    models = {name: _model_of(request.models, name) for name in grouped}
    digest = _digest(request)
    folders = (finding_row.FINDINGS, finding_row.VEHICLES)
    begun = open_folder(request.out, folders, digest, "map, options")
    tasks: list[VehicleTask] = []
    with progress_bar("reading logs", len(grouped), quiet=quiet) as advance:
        for task in _tasks(request, grouped, models, digest, begun):
            tasks.append(task)
            advance(1)
    missing: list[Task[VehicleTask]] = [(t.key, t) for t in tasks if finished(t) is None]
    with progress_bar("comparing", len(tasks), quiet=quiet) as advance:
        advance(len(tasks) - len(missing))
        workers = Workers(request.workers, request.scheduler)
        for _ in each_done(investigate_vehicle, missing, workers, failed_row):
            advance(1)
    remove_partial_files(request.out, folders)
    rows = [_row(request.out, task) for task in tasks]
    _write_lines(request.out, rows)
    result = FleetDiscrepancyResult(
        rows,
        summarise_fleet(rows, request.settings.false_alarm),
        len(tasks) - len(missing),
        len(list((request.out / finding_row.FINDINGS).glob("*.parquet"))) - len(tasks),
        time.perf_counter() - begin,
    )
    if not result.totals.examined:
        name, reason = next(iter(result.totals.failed.items()))
        expected = "expected at least one vehicle that can be examined, got none"
        raise fault("fleet", "", f"{expected}; {name}: {reason}")
    return result


def _model_of(models: str, vehicle: str) -> Path:
    """Model file of one vehicle."""
    folder = Path(models)
    if not folder.is_dir():
        return find_model(models)
    file = folder / f"{vehicle}.toml"
    if not file.is_file():
        raise fault(file, "", "expected a model file for each vehicle, got none of that name")
    return file


def _digest(request: FleetDiscrepancyRequest) -> str:
    """Digest of all but logs and models, which may differ from vehicle to vehicle, and grow."""
    parts = [
        _FORMAT,
        version("slopewise"),
        repr(request.settings),
        "" if request.map_file is None else map_digest(request.map_file),
        repr(request.nodata),
        "" if request.topics is None else read_text(request.topics),
    ]
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()


def _tasks(
    request: FleetDiscrepancyRequest,
    grouped: dict[str, list[Path]],
    models: dict[str, Path],
    digest: str,
    begun: str,
) -> Iterator[VehicleTask]:
    for vehicle, logs in grouped.items():
        for log in logs:
            if not log.is_dir():  # a recording
                check_file(log)
        model_file = models[vehicle]
        model = model_to_dict(read_model(model_file))
        source = source_of(logs, model_file, begun)
        key = json.dumps([digest, vehicle, source, model], sort_keys=True)
        yield VehicleTask(
            vehicle,
            tuple(log.resolve() for log in logs),
            model,
            model_file.name,
            begun,
            source,
            hashlib.sha256(key.encode()).hexdigest(),
            str(request.out.resolve()),
            None if request.map_file is None else request.map_file.resolve(),
            None if request.topics is None else request.topics.resolve(),
            request.settings,
            nodata=request.nodata,
        )


def _row(folder: Path, task: VehicleTask) -> Row:
    """The row on disk, so that a resumed run reports the same as an uninterrupted one."""
    row = finding_row.read(folder, task.vehicle, task.key)
    if row is None:
        file = folder / finding_row.FINDINGS / f"{task.vehicle}.parquet"
        raise fault(file, "", "expected the row that was written, got none: is the folder shared?")
    return row


def _write_lines(folder: Path, rows: list[Row]) -> None:
    """Write discrepancy.json of each vehicle as a line, without the computing time."""
    lines = []
    for row in rows:
        line = {name: row[name] for name in ("vehicle", "status", "reason")}
        if row["status"] == DONE:
            file = folder / finding_row.VEHICLES / row["vehicle"] / FINDINGS
            findings = json.loads(read_text(file))
            del findings["seconds"]
            line |= findings
        lines.append(json.dumps(line, allow_nan=False, ensure_ascii=False) + "\n")
    write_atomic(folder / LINES, "".join(lines).encode())
