"""What a worker does with one part: plan its paths window by window, write the results.

Workers hand nothing back but a count: results go to the shared folder, so that a worker that dies
takes nothing along, and none has to hold more than a part.
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
from slopewise.services.fleet import results
from slopewise.services.fleet.parts import FleetQuestion, Part
from slopewise.services.fleet.results import Refused
from slopewise.services.fleet.windows import MOST_CELLS, ground_in, opened, windows
from slopewise.services.io.map_grid import footprint_margin
from slopewise.services.io.model_file import model_from_dict


@dataclass(frozen=True, slots=True)
class PlanTask:
    """A part, what is asked about it, and the folder that all workers write to."""

    part: Part
    question: FleetQuestion
    folder: str


def plan_part(task: PlanTask) -> int:
    """Plan and write one part; gives the number of its candidates.

    Raises:
        InputError: the map cannot be read, or the folder not be written to.
    """
    part, question = task.part, task.question
    model = model_from_dict(question.model, "model")
    planner = CandidatePlanner(model, question.settings, question.uncertainty)
    answers: dict[int, SpeedPlan | Refused] = {}
    with opened(Path(question.map_file), question.nodata) as ground:
        margin = footprint_margin(model.vehicle, ground.info)
        for window in windows(part.paths, ground.info, margin):
            members = [part.paths[i] for i in window.members]
            if window.cells is None:
                words = f"expected a path on at most {MOST_CELLS} cells of the map, got more"
                found: list[SpeedPlan | Refused] = [Refused(p.name, words) for p in members]
            else:
                found = _planned(planner, ground_in(ground, window.cells), members, question)
            answers |= dict(zip(window.members, found, strict=True))
    ordered = [answers[i] for i in range(len(part.paths))]
    results.write(Path(task.folder), part.name.file, part.name.source.name, ordered)
    return len(ordered)


def _planned(
    planner: CandidatePlanner,
    ground: ElevationMap,
    paths: list[CandidatePath],
    question: FleetQuestion,
) -> list[SpeedPlan | Refused]:
    spacing = planner.settings.spacing_on(ground.resolution)
    max_deviation = planner.model.max_path_deviation
    even = [_even(path, spacing, max_deviation) for path in paths]
    good = [path for path in even if isinstance(path, EvenPath)]
    plans = iter(planner.plan(ground, good, start_speed=question.start_speed, clear=question.clear))
    return [path if isinstance(path, Refused) else next(plans) for path in even]


def _even(path: CandidatePath, spacing: float, max_deviation: float) -> EvenPath | Refused:
    """One path that is none must not keep the others from being planned."""
    try:
        return resample(path, spacing, max_deviation)
    except ParameterError as error:
        return Refused(path.name, f"{error.field}: expected {error.expected}")
