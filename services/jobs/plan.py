"""Plan candidate paths on an elevation map: ranked, verified speed plans."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.input_errors import describe_errors
from slopewise.models.parameters import Braking, Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.explain.explain import Explanation, explain
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors
from slopewise.planner.path import EvenPath
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.sentences import notes as swept_notes
from slopewise.services.io.map_file import frame_of
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import read_paths
from slopewise.services.jobs.ground import read_ground, refuse_topics
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import input_errors


class RefusedPath(NamedTuple):
    """A path of a file that cannot be planned, and why: one sentence."""

    candidate: str
    reason: str


@dataclass(frozen=True, slots=True)
class PlanResult:
    """Plans best first, and what they were made from; time without the wait for a compiler [s]."""

    plans: list[SpeedPlan]
    elevation_map: ElevationMap
    model: Model
    seconds: float
    uncertainty: Uncertainty | None = None
    explanation: Explanation | None = None
    files: tuple[Path, Path] | None = None  # map and model
    settings: PlannerSettings = field(default_factory=PlannerSettings)
    refused: tuple[RefusedPath, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions about map and vehicle, and what the map cannot show."""
        ground, limits = self.elevation_map, self.model.limits
        notes = (*ground.assumed, *swept_notes(self.model.vehicle, ground))
        errors = survived_errors(self.model, self.uncertainty)
        ends = max(self.model.front, self.model.vehicle.shape.rear)
        more = (self.model.steering_geometry.assumed, describe_errors(errors, ends))
        notes = (*notes, *(note for note in more if note))
        if self.model.tracking is None:
            notes = (*notes, "assumed without [tracking]: exactly on the line, without delay")
        if limits.max_path_deviation is not None:
            return notes
        limit = f"{self.model.max_path_deviation:.3g} m from a given path"
        return *notes, f"assumed from the vehicle's width: plans lead at most {limit}"

    @property
    def admissible(self) -> bool:
        """True if at least one plan may be driven and leads somewhere."""
        return any(plan.admissible for plan in self.plans)

    @property
    def states_uncertainty(self) -> bool:
        """True if the model has a covariance or a scatter, so that the quantile has an effect."""
        braking = self.model.braking
        surfaces: tuple[Braking | SurfaceBraking, ...] = (braking, *braking.terrain.values())
        return any(
            b.distance or b.covariance or b.force_std or b.force_scatter or b.dead_time_std
            for b in surfaces
        ) or any(effect.covariance for effect in self.model.effect)


def plan(
    map_file: Path,
    path_file: Path,
    model_file: str,
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
    settings: PlannerSettings | None = None,
    uncertainty: Uncertainty | None = None,
    explains: bool = False,
    topics: Path | None = None,
    nodata: NoData = None,
) -> PlanResult:
    """Read map, paths and model, plan and rank; speed in m/s, `clear` and `nodata` in metres.

    Without an uncertainty the plans are by the model's mean; `explains`: with an explanation of
    the best candidate.
    """
    found_model = find_model(model_file)
    model = read_model(found_model)
    refuse_topics(topics, map_file, path_file)
    paths = read_paths(path_file, topics, frame_of(map_file, topics))
    ground = read_ground(map_file, paths, path_file, model.vehicle, topics=topics, nodata=nodata)
    planner = CandidatePlanner(model, settings, uncertainty)
    with input_errors(path_file, ("speed", "clear")):
        usable, refused = without_refused(planner, ground, paths)
        plans, resampled, seconds = plan_paths(
            planner, ground, usable, start_speed=start_speed, clear=clear
        )
    explanation = None
    if explains:
        explanation = explain(
            model,
            ground,
            next(path for path in resampled if path.name == plans[0].candidate),
            settings=planner.settings,
            uncertainty=uncertainty,
            start_speed=start_speed,
            clear=clear,
        )
    return PlanResult(
        plans,
        ground,
        model,
        seconds,
        uncertainty,
        explanation,
        files=(map_file, found_model),
        settings=planner.settings,
        refused=refused,
    )


def without_refused(
    planner: CandidatePlanner, ground: ElevationMap, paths: Sequence[CandidatePath]
) -> tuple[list[EvenPath], tuple[RefusedPath, ...]]:
    """Paths that can be planned, on even stations, and the others: one refuses no file.

    Where none of them can be planned, the ParameterError of the first is raised.
    """
    usable: list[EvenPath] = []
    refused: list[RefusedPath] = []
    first: ParameterError | None = None
    for path in paths:
        try:
            usable += planner.resampled(ground, [path])
        except ParameterError as error:
            first = first or error
            refused.append(RefusedPath(path.name, str(error)))
    if first is not None and not usable:
        raise first
    return usable, tuple(refused)


def plan_paths(
    planner: CandidatePlanner,
    ground: ElevationMap,
    paths: Sequence[CandidatePath | EvenPath],
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
) -> tuple[list[SpeedPlan], list[EvenPath], float]:
    """Plan on ground that is in memory; plans best first, the resampled paths, and the time [s]."""
    begin = time.perf_counter()
    with progress_bar("planning", len(paths)) as advance:
        resampled = planner.resampled(ground, paths)
        plans = planner.plan(
            ground, resampled, start_speed=start_speed, clear=clear, progress=advance
        )
    seconds = time.perf_counter() - begin
    return rank(plans, planner.settings), resampled, seconds
