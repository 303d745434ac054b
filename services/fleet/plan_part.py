"""Path files cut into parts, and the task of a worker: plan and write one part.

How files are cut depends only on their content, so that any number of workers gives the same
parts with the same bytes. The key of a part is a digest of all that its plans depend on: paths,
model, map, settings and version. Workers return only a count: results go to the shared folder, so
that a worker that dies loses no results, and none has to hold more than a part.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.followed_line import line_limits
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import EvenPath, resample
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.services.fleet.map_windows import MAX_CELLS, ground_in, map_windows, opened
from slopewise.services.fleet.plan_results import write_part
from slopewise.services.fleet.result_folder import digest_of, map_digest
from slopewise.services.io.map_grid import Extent, footprint_margin
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map, read_paths
from slopewise.services.jobs.plan import RefusedPath

PART = 500  # Candidates of a part: a few seconds of work, some megabytes of results
_FORMAT = 2  # Version of the results; results of another one are planned again


@dataclass(frozen=True, slots=True)
class FleetPlanRequest:
    """Paths, map, model and options of a fleet's plans. Speeds in m/s, lengths in m."""

    map_file: Path
    path_files: Sequence[Path]
    model_file: str
    out: Path
    start_speed: float
    clear: float
    settings: PlannerSettings
    uncertainty: Uncertainty | None
    workers: int | None = None
    scheduler: str = ""
    nodata: NoData = None

    def digest(self, model: dict[str, Any]) -> str:
        """Digest of all but the paths; ``model`` has the tables of the model file."""
        options = (self.settings, float(self.start_speed), float(self.clear), self.uncertainty)
        return digest_of(
            _FORMAT,
            PART,
            map_digest(self.map_file),
            json.dumps(model, sort_keys=True),
            *map(repr, (*options, self.nodata)),
        )


class PartName(NamedTuple):
    """Origin of a part: file of the paths, first candidate, their number, digest of inputs."""

    source: Path
    first: int
    size: int
    key: str

    @property
    def file(self) -> str:
        """Name of its result files: readable at the front, unique at the end."""
        return f"{self.source.stem[:60]}-{self.first:07d}-{self.key[:20]}.parquet"


@dataclass(frozen=True, slots=True)
class PlanTask:
    """A part with its paths, what is planned on them, and the tables of the model file."""

    name: PartName
    paths: tuple[CandidatePath, ...]
    request: FleetPlanRequest
    model: dict[str, Any]


def parts_of(
    source: Path, digest: str, extent: Extent, map_file: Path
) -> Iterator[tuple[PartName, tuple[CandidatePath, ...]]]:
    """The parts of one file, whose paths have to begin in the map's extent [m]."""
    paths = read_paths(source)
    check_paths_on_map(paths, extent, str(source), str(map_file))
    for first in range(0, len(paths), PART):
        members = tuple(paths[first : first + PART])
        yield PartName(source, first, len(members), _key(digest, source, first, members)), members


def _key(request: str, source: Path, first: int, paths: Sequence[CandidatePath]) -> str:
    digest = hashlib.sha256(json.dumps([request, source.name, first]).encode())
    for path in paths:
        digest.update(json.dumps([path.name, len(path.points)]).encode())
        for values in (path.points, path.speed_limit, path.yaw):
            digest.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def plan_part(task: PlanTask) -> int:
    """Plan one part window by window and write it; returns the number of its candidates."""
    request, name = task.request, task.name
    planner = CandidatePlanner(
        model_from_dict(task.model, "model"), request.settings, request.uncertainty
    )
    answers: dict[int, SpeedPlan | RefusedPath] = {}
    with opened(request.map_file, request.nodata) as ground:
        margin = footprint_margin(planner.model.vehicle, ground.info)
        for members, cells in map_windows(task.paths, ground.info, margin):
            if cells is None:
                message = f"expected a path on at most {MAX_CELLS} cells of the map, got more"
                answers |= {i: RefusedPath(task.paths[i].name, message) for i in members}
            else:
                paths = {i: task.paths[i] for i in members}
                answers |= _plan(planner, ground_in(ground, cells), paths, request)
    ordered = [answers[i] for i in range(len(task.paths))]
    write_part(request.out, name.file, name.source.name, ordered)
    return len(ordered)


def _plan(
    planner: CandidatePlanner,
    ground: ElevationMap,
    paths: Mapping[int, CandidatePath],
    request: FleetPlanRequest,
) -> dict[int, SpeedPlan | RefusedPath]:
    """Plan paths by their number; one that cannot be used does not prevent the others."""
    spacing = planner.settings.spacing_on(ground.resolution, planner.model.vehicle)
    limits = line_limits(planner.model)
    even: dict[int, EvenPath] = {}
    rejected: dict[int, SpeedPlan | RefusedPath] = {}
    for i, path in paths.items():
        try:
            even[i] = resample(path, spacing, limits)
        except ParameterError as error:
            rejected[i] = RefusedPath(path.name, str(error))
    usable = list(even.values())
    plans = planner.plan(ground, usable, start_speed=request.start_speed, clear=request.clear)
    return rejected | dict(zip(even, plans, strict=True))
