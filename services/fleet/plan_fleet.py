"""Plan many paths over a large map, in parts, on several processes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from slopewise.models.errors import InputError
from slopewise.services.fleet.map_windows import opened
from slopewise.services.fleet.plan_part import (
    FleetPlanRequest,
    PartName,
    PlanTask,
    parts_of,
    plan_part,
)
from slopewise.services.fleet.plan_results import CANDIDATES, PLANS, count, is_finished
from slopewise.services.fleet.result_folder import open_folder, remove_partial_files
from slopewise.services.fleet.scheduler import Task, Workers, check_installed, each_done
from slopewise.services.io.files import fault
from slopewise.services.io.map_grid import MapInfo
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary


class FleetPlanSummary(Summary, frozen=True, kw_only=True):
    """Output of `fleet plan --json`: numbers of candidates, and of parts of other paths."""

    model: str
    admissible: bool
    candidates: int
    planned: int
    resumed: int
    driven: int = msgspec.field(name="may_be_driven")
    statuses: dict[str, int]
    unexpected: int = msgspec.field(name="strays")
    seconds: float
    notes: list[str]


def plan_fleet(request: FleetPlanRequest) -> FleetPlanSummary:
    """Plan the candidates that are not planned yet, and count all.

    All files are read before the first plan, so that an error in the last one is reported early.
    """
    begin = time.perf_counter()
    check_installed()
    _check_numbers(request)
    model = model_to_dict(read_model(find_model(request.model_file)))
    with opened(request.map_file, request.nodata) as ground:
        info, notes = ground.info, ground.assumed
    digest, out = request.digest(model), request.out
    _check_names(request.path_files)
    open_folder(out, (PLANS, CANDIDATES), digest, "map, model, options")
    names: list[PartName] = []
    with progress_bar("reading paths", len(request.path_files)) as advance:
        for source in request.path_files:
            names += [name for name, _ in parts_of(source, digest, info.extent, request.map_file)]
            advance(1)
    missing = [name for name in names if not is_finished(out, name.file)]
    candidates = sum(name.size for name in names)
    resumed = candidates - sum(name.size for name in missing)
    with progress_bar("planning", candidates) as advance:
        advance(resumed)
        tasks = _tasks(request, model, digest, info, missing)
        for done in each_done(plan_part, tasks, Workers(request.workers, request.scheduler)):
            advance(done)
    remove_partial_files(out, (PLANS, CANDIDATES))
    statuses, driven = count(out, [name.file for name in names])
    return FleetPlanSummary(
        model=model["name"],
        admissible=driven > 0,
        candidates=candidates,
        planned=candidates - resumed,
        resumed=resumed,
        driven=driven,
        statuses=dict(sorted(statuses.items())),
        unexpected=len(list((out / CANDIDATES).glob("*.parquet"))) - len(names),
        seconds=time.perf_counter() - begin,
        notes=list(notes),
    )


def _tasks(
    request: FleetPlanRequest,
    model: dict[str, Any],
    digest: str,
    info: MapInfo,
    missing: list[PartName],
) -> Iterator[Task[PlanTask]]:
    """Parts with their paths, one file in memory at a time."""
    keys = {name.key for name in missing}
    resolved = replace(request, map_file=request.map_file.resolve(), out=request.out.resolve())
    for source in dict.fromkeys(name.source for name in missing):
        for name, paths in parts_of(source, digest, info.extent, request.map_file):
            if name.key in keys:
                yield name.key, PlanTask(name, paths, resolved, model)


def _check_numbers(request: FleetPlanRequest) -> None:
    speed, clear = request.start_speed, request.clear
    if not (np.isfinite(speed) and speed >= 0.0):
        raise InputError("--speed", "", f"expected a finite start speed >= 0 [m/s], got {speed}")
    if np.isnan(clear) or clear < 0.0:
        raise InputError("--clear", "", f"expected a distance >= 0 [m], got {clear}")


def _check_names(files: Sequence[Path]) -> None:
    """Raise InputError for a duplicate name: results distinguish candidates by their file's."""
    by_name: dict[str, Path] = {}
    for file in files:
        first = by_name.setdefault(file.name, file)
        if first != file or list(files).count(file) > 1:
            raise fault(file, "", f"expected a unique file name, got that of {first}")
