"""Compare the logs of many vehicles with their models, one by one, and count the effects."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from pathlib import Path

from slopewise.services.fleet.fleet_summary import FleetSummary, summarise_fleet
from slopewise.services.fleet.result_folder import (
    digest_of,
    map_digest,
    open_folder,
    remove_partial_files,
    vehicles_of,
)
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.fleet.vehicle_finding import (
    DONE,
    FINDINGS,
    VEHICLES,
    FleetDiscrepancyRequest,
    Row,
    VehicleTask,
    finished,
    investigate_vehicle,
    read_row,
    write_failed_row,
)
from slopewise.services.io import findings_file
from slopewise.services.io.files import check_file, fault, read_text, write_atomic
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.jobs.progress import progress_bar

LINES, PAGE = "findings.jsonl", "report.html"
"""One line per vehicle, and the page of the fleet."""

_FORMAT = 1  # Format of the results; those of another format are computed again


def investigate_fleet(request: FleetDiscrepancyRequest) -> tuple[list[Row], FleetSummary]:
    """Examine the vehicles that no earlier run has examined, count all, write the lines.

    Returns the rows of all vehicles in the order given, and what `--json` prints of them.
    """
    begin = time.perf_counter()
    check_installed()
    grouped = vehicles_of(request.logs.files, request.by_folder)
    models = {name: _model_of(request.models, name) for name in grouped}
    digest = _digest(request)
    out, folders = request.out, (FINDINGS, VEHICLES)
    begun = open_folder(out, folders, digest, "map, options")
    tasks: list[VehicleTask] = []
    with progress_bar("reading logs", len(grouped)) as advance:
        for vehicle, logs in grouped.items():
            tasks.append(_task(vehicle, logs, models[vehicle], request, digest, begun))
            advance(1)
    missing: list[Task[VehicleTask]] = [(t.key, t) for t in tasks if finished(t) is None]
    with progress_bar("comparing", len(tasks)) as advance:
        advance(len(tasks) - len(missing))
        workers = Workers(request.workers, request.scheduler)
        for _ in each_done(investigate_vehicle, missing, workers, write_failed_row):
            advance(1)
    remove_partial_files(out, folders)
    rows = [_row(task) for task in tasks]
    _write_lines(out, rows)
    summary = summarise_fleet(
        rows,
        request.settings.false_alarm,
        resumed=len(tasks) - len(missing),
        unexpected=len(list((out / FINDINGS).glob("*.parquet"))) - len(tasks),
        seconds=time.perf_counter() - begin,
    )
    if not summary.examined:
        name, reason = next(iter(summary.failed.items()))
        expected = "expected at least one vehicle that can be examined, got none"
        raise fault("fleet", "", f"{expected}; {name}: {reason}")
    return rows, summary


def _digest(request: FleetDiscrepancyRequest) -> str:
    """Digest of all but logs and models, which may differ from vehicle to vehicle, and grow."""
    logs = request.logs
    return digest_of(
        _FORMAT,
        repr(request.settings),
        "" if logs.map_file is None else map_digest(logs.map_file),
        repr(logs.nodata),
        "" if logs.topics is None else read_text(logs.topics),
    )


def _model_of(models: str, vehicle: str) -> Path:
    folder = Path(models)
    if not folder.is_dir():
        return find_model(models)
    file = folder / f"{vehicle}.toml"
    if not file.is_file():
        raise fault(file, "", "expected a model file for each vehicle, got none of that name")
    return file


def _task(
    vehicle: str,
    logs: Sequence[Path],
    model_file: Path,
    request: FleetDiscrepancyRequest,
    digest: str,
    begun: str,
) -> VehicleTask:
    for log in logs:
        if not log.is_dir():  # a recording
            check_file(log)
    model = model_to_dict(read_model(model_file))
    source = findings_file.source_of(logs, model_file, begun)
    key = json.dumps([digest, vehicle, source, model], sort_keys=True)
    return VehicleTask(
        vehicle,
        request.logs.resolved(logs),
        model,
        model_file.name,
        begun,
        source,
        hashlib.sha256(key.encode()).hexdigest(),
        request.settings,
        request.out.resolve(),
    )


def _row(task: VehicleTask) -> Row:
    """The row on disk, so that a resumed run reports the same as an uninterrupted one."""
    row = read_row(task)
    if row is None:
        expected = "expected the row that was written, got none: is the folder shared?"
        raise fault(task.row_file, "", expected)
    return row


def _write_lines(folder: Path, rows: list[Row]) -> None:
    """Write discrepancy.json of each vehicle as a line, without the computing time."""
    lines = []
    for row in rows:
        line = {name: row[name] for name in ("vehicle", "status", "reason")}
        if row["status"] == DONE:
            file = folder / VEHICLES / row["vehicle"] / findings_file.FINDINGS
            findings = json.loads(read_text(file))
            del findings["seconds"]
            line |= findings
        lines.append(json.dumps(line, allow_nan=False, ensure_ascii=False) + "\n")
    write_atomic(folder / LINES, "".join(lines).encode())
