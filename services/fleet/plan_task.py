"""Task of a worker: plan the paths of one part window by window, write the results.

Workers return only a count: results go to the shared folder, so that a worker that dies loses no
results, and none has to hold more than a part.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.path import EvenPath, resample
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.services.fleet.map_windows import MAX_CELLS, ground_in, map_windows, opened
from slopewise.services.fleet.parquet_results import RejectedCandidate, write_part
from slopewise.services.fleet.parts import FleetPlanSpec, Part
from slopewise.services.io.map_grid import footprint_margin
from slopewise.services.io.model_file import model_from_dict


@dataclass(frozen=True, slots=True)
class PlanTask:
    """A part, what to plan on it, and the folder that all workers write to."""

    part: Part
    spec: FleetPlanSpec
    folder: str


def plan_part(task: PlanTask) -> int:
    """Plan and write one part; returns the number of its candidates."""
    part, spec = task.part, task.spec
    model = model_from_dict(spec.model, "model")
    planner = CandidatePlanner(model, spec.settings, spec.uncertainty)
    answers: dict[int, SpeedPlan | RejectedCandidate] = {}
    with opened(Path(spec.map_file), spec.nodata) as ground:
        margin = footprint_margin(model.vehicle, ground.info)
        for window in map_windows(part.paths, ground.info, margin):
            members = [part.paths[i] for i in window.members]
            if window.cells is None:
                message = f"expected a path on at most {MAX_CELLS} cells of the map, got more"
                planned: list[SpeedPlan | RejectedCandidate] = [
                    RejectedCandidate(p.name, message) for p in members
                ]
            else:
                planned = _plan(planner, ground_in(ground, window.cells), members, spec)
            answers |= dict(zip(window.members, planned, strict=True))
    ordered = [answers[i] for i in range(len(part.paths))]
    write_part(Path(task.folder), part.name.file, part.name.source.name, ordered)
    return len(ordered)


def _plan(
    planner: CandidatePlanner,
    ground: ElevationMap,
    paths: list[CandidatePath],
    spec: FleetPlanSpec,
) -> list[SpeedPlan | RejectedCandidate]:
    spacing = planner.settings.spacing_on(ground.resolution)
    max_deviation = planner.model.max_path_deviation
    resampled = [_resample(path, spacing, max_deviation) for path in paths]
    usable = [path for path in resampled if isinstance(path, EvenPath)]
    plans = iter(planner.plan(ground, usable, start_speed=spec.start_speed, clear=spec.clear))
    return [path if isinstance(path, RejectedCandidate) else next(plans) for path in resampled]


def _resample(
    path: CandidatePath, spacing: float, max_deviation: float
) -> EvenPath | RejectedCandidate:
    """Resample, or reject: one path that cannot be used must not prevent planning of the others."""
    try:
        return resample(path, spacing, max_deviation)
    except ParameterError as error:
        return RejectedCandidate(path.name, f"{error.field}: expected {error.expected}")
