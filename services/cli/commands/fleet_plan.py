"""`slopewise fleet plan`: many paths over a large map, in parts, on several processes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from slopewise.models.errors import InputError
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.settings import PlannerSettings
from slopewise.services.cli.screen import progress_bar
from slopewise.services.fleet import parquet_results
from slopewise.services.fleet.map_windows import opened
from slopewise.services.fleet.parts import FleetPlanSpec, PartName, parts_of
from slopewise.services.fleet.plan_task import PlanTask, plan_part
from slopewise.services.fleet.result_folder import open_folder, remove_partial_files
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.io.files import fault
from slopewise.services.io.map_grid import MapInfo
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.planning.cold_start import compile_first
from slopewise.services.report.plan_labels import plural


@dataclass(frozen=True, slots=True)
class FleetPlanJob:
    """What to plan, as the command line gives it. Speeds in m/s, lengths in m."""

    map_file: Path
    path_files: Sequence[Path]
    model_file: str
    out: Path
    start_speed: float = 0.0
    clear: float = np.inf
    settings: PlannerSettings = field(default_factory=PlannerSettings)
    uncertainty: Uncertainty | None = field(default_factory=Uncertainty)
    workers: int | None = None
    scheduler: str = ""
    nodata: NoData = None


@dataclass(frozen=True, slots=True)
class FleetPlanResult:
    """What was done.

    Attributes:
        model: its name. planned: candidates of this run. resumed: those that were there already.
        statuses: number of candidates by status. driven: those that may be driven.
        strays: parts in the folder that are of other paths. seconds: it took.
        notes: assumptions made of the map.
    """

    model: str
    planned: int
    resumed: int
    statuses: dict[str, int]
    driven: int
    strays: int
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def admissible(self) -> bool:
        """At least one candidate may be driven and leads somewhere."""
        return self.driven > 0


def run(job: FleetPlanJob, *, quiet: bool = False) -> FleetPlanResult:
    """Look through all paths, plan those that are not planned yet, count.

    Every file is read before anything is planned: what is wrong with the last one is said at once.

    Raises:
        InputError: names file and field.
    """
    begin = time.perf_counter()
    check_installed()
    _check_numbers(job)
    model = read_model(find_model(job.model_file))
    with opened(job.map_file, job.nodata) as ground:
        info, notes = ground.info, ground.assumed
    question = FleetPlanSpec(
        str(job.map_file.resolve()),
        model_to_dict(model),
        job.settings,
        job.start_speed,
        job.clear,
        job.uncertainty,
        job.nodata,
    )
    digest = question.digest()
    _check_names(job.path_files)
    open_folder(
        job.out, (parquet_results.PLANS, parquet_results.CANDIDATES), digest, "map, model, options"
    )
    names: list[PartName] = []
    with progress_bar("looking through paths", len(job.path_files), quiet=quiet) as advance:
        for source in job.path_files:
            names += [part.name for part in parts_of(source, digest, info.extent, _said(job))]
            advance(1)
    missing = [name for name in names if not parquet_results.is_finished(job.out, name.file)]
    candidates = sum(name.count for name in names)
    resumed = candidates - sum(name.count for name in missing)
    if missing and not job.scheduler:
        compile_first("plans come after that")
    with progress_bar("planning", candidates, quiet=quiet) as advance:
        advance(resumed)
        tasks = _tasks(job, question, digest, info, missing)
        for count in each_done(plan_part, tasks, Workers(job.workers, job.scheduler)):
            advance(count)
    remove_partial_files(job.out, (parquet_results.PLANS, parquet_results.CANDIDATES))
    statuses, driven = parquet_results.count(job.out, [name.file for name in names])
    there = len(list((job.out / parquet_results.CANDIDATES).glob("*.parquet")))
    return FleetPlanResult(
        model.name,
        candidates - resumed,
        resumed,
        dict(sorted(statuses.items())),
        driven,
        there - len(names),
        time.perf_counter() - begin,
        notes,
    )


def _said(job: FleetPlanJob) -> str:
    return str(job.map_file)


def _tasks(
    job: FleetPlanJob, question: FleetPlanSpec, digest: str, info: MapInfo, missing: list[PartName]
) -> Iterator[Task[PlanTask]]:
    """Parts with their paths, one file in memory at a time."""
    keys = {name.key for name in missing}
    folder = str(job.out.resolve())
    for source in dict.fromkeys(name.source for name in missing):
        for part in parts_of(source, digest, info.extent, _said(job)):
            if part.name.key in keys:
                yield part.name.key, PlanTask(part, question, folder)


def _check_numbers(job: FleetPlanJob) -> None:
    if not (np.isfinite(job.start_speed) and job.start_speed >= 0.0):
        words = f"expected a finite start speed >= 0 [m/s], got {job.start_speed}"
        raise InputError("--speed", "", words)
    if np.isnan(job.clear) or job.clear < 0.0:
        raise InputError("--clear", "", f"expected a distance >= 0 [m], got {job.clear}")


def _check_names(files: Sequence[Path]) -> None:
    """Results tell candidates apart by the name of their file."""
    seen: dict[str, Path] = {}
    for file in files:
        other = seen.setdefault(file.name, file)
        if other != file or list(files).count(file) > 1:
            raise fault(file, "", f"expected a file name of its own, got that of {other}")


def as_json(result: FleetPlanResult) -> dict[str, Any]:
    """For machines."""
    return {
        "model": result.model,
        "admissible": result.admissible,
        "candidates": result.planned + result.resumed,
        "planned": result.planned,
        "resumed": result.resumed,
        "may_be_driven": result.driven,
        "statuses": result.statuses,
        "strays": result.strays,
        "seconds": result.seconds,
        "notes": list(result.notes),
    }


def show(result: FleetPlanResult, console: Console) -> None:
    """What was planned, and how it came out."""
    kinds = ", ".join(f"{count} {name}" for name, count in result.statuses.items())
    candidates = plural(result.planned + result.resumed, "candidate")
    console.print(f"{result.model}: {candidates}: {kinds}")
    console.print(f"{result.driven} may be driven")
    if result.resumed:
        console.print(f"{result.resumed} of them were planned by an earlier run")
    if result.strays:
        parts = plural(result.strays, "part")
        console.print(f"note: of other paths: {parts} in the folder", style="yellow")
    for note in result.notes:
        console.print(f"note: {note}", style="yellow")
    rate = result.planned / result.seconds
    console.print(f"{result.seconds:.1f} s, {rate:.0f} candidates planned a second")
