"""`slopewise fleet discrepancy`: which vehicles lack which effect, one by one and counted."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.services.cli.screen import progress_bar
from slopewise.services.fleet import finding_row
from slopewise.services.fleet.discrepancy_task import (
    VehicleTask,
    failed_row,
    finished,
    investigate_vehicle,
)
from slopewise.services.fleet.finding_row import DONE, Row
from slopewise.services.fleet.fleet_summary import EffectPrevalence, FleetSummary, summarise_fleet
from slopewise.services.fleet.fleet_text import (
    format_effects,
    format_false_alarms,
    format_parameters,
    list_failed,
    prevalence_cells,
    sort_by_prediction_error,
)
from slopewise.services.fleet.parts import map_digest
from slopewise.services.fleet.result_folder import open_folder, remove_partial_files
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.fleet.vehicle_logs import vehicles_of
from slopewise.services.io.files import check_file, fault, read_text, write_atomic
from slopewise.services.io.findings_file import FINDINGS, source_of
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.report.plan_labels import plural

LINES, PAGE = "findings.jsonl", "report.html"
"""A line a vehicle, and the page of the fleet."""

_FORMAT = 1  # of the results; another one is looked at anew
_LISTED = 30


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyJob:
    """What to compare, as the command line gives it.

    Attributes:
        logs: drive logs or ROS 2 bags. models: a model file or name for all vehicles, or a folder
            with NAME.toml for each. out: folder of the results.
        by_folder: logs of a folder are of one vehicle; else each file is of its own.
        map_file: elevation map that the logs' x, y lie on, if there is one.
        topics: topic mapping of the bags. settings: how sure to be.
        pages: draw a page for each vehicle and one for the fleet. nodata: height that marks
            unknown ground [m], see `--nodata`.
    """

    logs: Sequence[Path]
    models: str
    out: Path
    by_folder: bool = False
    map_file: Path | None = None
    topics: Path | None = None
    settings: DiscrepancySettings | None = None
    pages: bool = True
    workers: int | None = None
    scheduler: str = ""
    nodata: NoData = None


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyResult:
    """What was found.

    Attributes:
        rows: of all vehicles, in the order given. summary: of them. resumed: vehicles that an
            earlier run had looked at. strays: vehicles in the folder that are not among these.
        seconds: it took.
    """

    rows: list[Row]
    summary: FleetSummary
    resumed: int
    strays: int
    seconds: float


def run(job: FleetDiscrepancyJob, *, quiet: bool = False) -> FleetDiscrepancyResult:
    """Look at the vehicles that have not been looked at, count all, write the lines and the page.

    Raises:
        InputError: names file and field; or not one vehicle could be looked at.
    """
    begin = time.perf_counter()
    check_installed()
    grouped = vehicles_of(job.logs, job.by_folder)
    models = {name: _model_of(job.models, name) for name in grouped}
    question = _question(job)
    folders = (finding_row.FINDINGS, finding_row.VEHICLES)
    begun = open_folder(job.out, folders, question, "map, options")
    tasks: list[VehicleTask] = []
    with progress_bar("looking through logs", len(grouped), quiet=quiet) as advance:
        for task in _tasks(job, grouped, models, question, begun):
            tasks.append(task)
            advance(1)
    left: list[Task[VehicleTask]] = [(t.key, t) for t in tasks if finished(t) is None]
    with progress_bar("comparing", len(tasks), quiet=quiet) as advance:
        advance(len(tasks) - len(left))
        workers = Workers(job.workers, job.scheduler)
        for _ in each_done(investigate_vehicle, left, workers, failed_row):
            advance(1)
    remove_partial_files(job.out, folders)
    rows = [_row(job.out, task) for task in tasks]
    _write_lines(job.out, rows)
    settings = job.settings or DiscrepancySettings()
    result = FleetDiscrepancyResult(
        rows,
        summarise_fleet(rows, settings.false_alarm),
        len(tasks) - len(left),
        len(list((job.out / finding_row.FINDINGS).glob("*.parquet"))) - len(tasks),
        time.perf_counter() - begin,
    )
    if not result.summary.examined:
        name, why = next(iter(result.summary.failed.items()))
        words = f"expected at least one vehicle that can be looked at, got none; {name}: {why}"
        raise fault("fleet", "", words)
    if job.pages:
        from slopewise.services.fleet.fleet_page import write_fleet_page

        write_fleet_page(job.out / PAGE, rows, result.summary)
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


def _question(job: FleetDiscrepancyJob) -> str:
    """Digest of all but logs and models: those may differ from vehicle to vehicle, and grow."""
    told = [
        _FORMAT,
        version("slopewise"),
        repr(job.settings or DiscrepancySettings()),
        "" if job.map_file is None else map_digest(job.map_file),
        repr(job.nodata),
        "" if job.topics is None else read_text(job.topics),
    ]
    return hashlib.sha256("\n".join(map(str, told)).encode()).hexdigest()


def _tasks(
    job: FleetDiscrepancyJob,
    grouped: dict[str, list[Path]],
    models: dict[str, Path],
    question: str,
    begun: str,
) -> Iterator[VehicleTask]:
    for vehicle, logs in grouped.items():
        for log in logs:
            if not log.is_dir():  # a recording
                check_file(log)
        model_file = models[vehicle]
        model = model_to_dict(read_model(model_file))
        source = source_of(logs, model_file, begun)
        told = json.dumps([question, vehicle, source, model], sort_keys=True)
        yield VehicleTask(
            vehicle,
            tuple(log.resolve() for log in logs),
            model,
            model_file.name,
            begun,
            source,
            hashlib.sha256(told.encode()).hexdigest(),
            str(job.out.resolve()),
            None if job.map_file is None else job.map_file.resolve(),
            None if job.topics is None else job.topics.resolve(),
            job.settings,
            job.pages,
            job.nodata,
        )


def _row(folder: Path, task: VehicleTask) -> Row:
    """As it is on disk, so that a run that goes on tells what one that did all tells."""
    row = finding_row.read(folder, task.vehicle, task.key)
    if row is None:
        file = folder / finding_row.FINDINGS / f"{task.vehicle}.parquet"
        raise fault(file, "", "expected the row that was written, got none: is the folder shared?")
    return row


def _write_lines(folder: Path, rows: list[Row]) -> None:
    """What each vehicle's discrepancy.json holds, but for the time it took."""
    lines = []
    for row in rows:
        line = {name: row[name] for name in ("vehicle", "status", "reason")}
        if row["status"] == DONE:
            file = folder / finding_row.VEHICLES / row["vehicle"] / FINDINGS
            told = json.loads(read_text(file))
            del told["seconds"]
            line |= told
        lines.append(json.dumps(line, allow_nan=False, ensure_ascii=False) + "\n")
    write_atomic(folder / LINES, "".join(lines).encode())


def as_json(result: FleetDiscrepancyResult) -> dict[str, Any]:
    """The count for machines; findings.jsonl has what was found of each vehicle."""
    c = result.summary
    return {
        "vehicles": len(result.rows),
        "looked_at": c.examined,
        "verdicts": c.verdicts,
        "without_answer": c.failed,
        "effects": [
            {
                "name": one.name,
                "vehicles": list(one.vehicles),
                "perhaps": list(one.ambiguous_in),
                "confidence": None if one.confidence is None else list(one.confidence),
                "expected_right": one.expected_true,
                "parameters": {
                    name: {"unit": unit, "least": low, "median": middle, "most": high}
                    for name, (unit, low, middle, high) in one.parameters.items()
                },
            }
            for one in c.effects
        ],
        "by_chance": c.expected_false,
        "resumed": result.resumed,
        "strays": result.strays,
        "seconds": result.seconds,
    }


def show(result: FleetDiscrepancyResult, console: Console) -> None:
    """The fleet by verdict and by effect, then the vehicles with the longest surprises."""
    c = result.summary
    told = ", ".join(f"{count} {name}" for name, count in c.verdicts.items())
    console.print(f"{c.examined} of {len(result.rows)} vehicles looked at: {told}")
    if c.effects:
        console.print(_effects(c.effects, c.examined))
    console.print(_vehicles(result.rows))
    console.print(format_false_alarms(c), style="dim")
    for words in list_failed(c, _LISTED):
        console.print(f"note: {escape(words)}", style="yellow")
    if result.resumed:
        console.print(f"{result.resumed} of them were looked at by an earlier run")
    if result.strays:
        words = f"note: not among these: {plural(result.strays, 'vehicle')} in the folder"
        console.print(words, style="yellow")


def _effects(lacked: Sequence[EffectPrevalence], looked_at: int) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    titles = ("effect", "missing in", "how sure", "of them right", "perhaps in", "numbers")
    for title in titles:
        table.add_column(title, justify="left" if title in ("effect", "numbers") else "right")
    for one in lacked:
        table.add_row(one.name, *prevalence_cells(one, looked_at), format_parameters(one))
    return table


def _vehicles(rows: Sequence[Row]) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("vehicle", "stops", "verdict", "effects", "stops off by\nm, before", "after"):
        left = title in ("vehicle", "verdict", "effects")
        table.add_column(title, justify="left" if left else "right")
    done = sort_by_prediction_error(rows)
    for row in done[:_LISTED]:
        before, after = (f"{row[f'stop_distance_{when}']:.2f}" for when in ("before", "after"))
        name, verdict = escape(row["vehicle"]), row["verdict"]
        table.add_row(name, str(row["stops"]), verdict, format_effects(row), before, after)
    if len(done) > _LISTED:
        table.caption = f"… and {len(done) - _LISTED} more, in {LINES}"
    return table
