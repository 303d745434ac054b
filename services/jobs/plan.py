"""Plan candidate paths on an elevation map: ranked, verified speed plans."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking, Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.explain.explain import Explanation, explain
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.interpreted import is_interpreting
from slopewise.planner.path import EvenPath
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.sentences import notes as swept_notes
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.io.bags import is_bag
from slopewise.services.io.map_file import frame_of, map_info, read_map
from slopewise.services.io.map_grid import footprint_margin
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map, read_paths
from slopewise.services.io.plan_file import driven, read_external_plans
from slopewise.services.jobs.check import CheckResult, check_plans
from slopewise.services.jobs.cold_start import sooner, stations_of
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import input_errors


@dataclass(frozen=True, slots=True)
class PlanResult:
    """Plans best first, and what they were made from.

    Attributes:
        seconds: time of planning, without the wait for a compiler [s].
        files: map and model, if from files.
    """

    plans: list[SpeedPlan]
    elevation_map: ElevationMap
    model: Model
    seconds: float
    uncertainty: Uncertainty | None = None
    explanation: Explanation | None = None
    check: CheckResult | None = None
    files: tuple[Path, Path] | None = None
    settings: PlannerSettings = field(default_factory=PlannerSettings)

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions about map and vehicle, and what the map cannot show."""
        ground, limits = self.elevation_map, self.model.limits
        notes = (*ground.assumed, *swept_notes(self.model.vehicle, ground.resolution))
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
            b.covariance or b.force_std or b.force_scatter or b.dead_time_std for b in surfaces
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
    quiet: bool = True,
) -> PlanResult:
    """Read map, paths and model, plan and rank.

    Args:
        map_file: elevation map.
        path_file: candidate paths.
        model_file: model file or shipped vehicle.
        start_speed: speed at the first station [m/s].
        clear: station up to which the path is known to be free [m].
        settings: spacing, smoothing, weights of the ranking.
        uncertainty: quantile of the margins; None plans with the model's mean.
        explains: with an explanation of the best candidate.
        topics: topic mapping of recordings.
        nodata: height of the map that marks unknown ground [m].
        quiet: without a progress bar.

    Raises:
        InputError: names file and field.
    """
    found_model = find_model(model_file)
    model = read_model(found_model)
    if topics is not None and not (is_bag(map_file) or is_bag(path_file)):
        raise InputError(
            str(topics), "", "expected a recording with a topic mapping, got files of other kinds"
        )
    paths = read_paths(path_file, topics, frame_of(map_file, topics))
    info = map_info(map_file, topics)
    check_paths_on_map(paths, info.extent, str(path_file), str(map_file))
    around = _around(paths, footprint_margin(model.vehicle, info))
    ground = read_map(map_file, around=around, topics=topics, nodata=nodata)
    planner = CandidatePlanner(model, settings, uncertainty)
    with input_errors(path_file, ("speed", "clear")):
        plans, resampled, seconds = plan_paths(
            planner, ground, paths, start_speed=start_speed, clear=clear, quiet=quiet
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
    )


def plan_paths(
    planner: CandidatePlanner,
    ground: ElevationMap,
    paths: Sequence[CandidatePath],
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
    quiet: bool | None = None,
) -> tuple[list[SpeedPlan], list[EvenPath], float]:
    """Plan on ground that is in memory; plans best first, the resampled paths, and the time [s].

    Args:
        planner: with model, settings and quantile.
        ground: elevation map.
        paths: candidates.
        start_speed: speed at the first station [m/s].
        clear: station up to which the path is known to be free [m].
        quiet: without a progress bar; None: with one while kernels run as Python, which takes long.

    Raises:
        ParameterError: names the candidate or the argument, and what was expected.
    """
    spacing = planner.settings.spacing_on(ground.resolution)

    def planned() -> tuple[list[EvenPath], list[SpeedPlan], float]:
        begin = time.perf_counter()
        hidden = not is_interpreting() if quiet is None else quiet
        with progress_bar("planning", len(paths), quiet=hidden) as advance:
            resampled = planner.resampled(ground, paths)
            plans = planner.plan(
                ground, resampled, start_speed=start_speed, clear=clear, progress=advance
            )
        return resampled, plans, time.perf_counter() - begin

    resampled, plans, seconds = sooner(planned, lambda: stations_of(paths, spacing))
    return rank(plans, planner.settings), resampled, seconds


def with_check(
    result: PlanResult, written: Path | None, clear: float, *, quiet: bool = True
) -> PlanResult:
    """Add the independent check, of the table if one was written, else of the plans."""
    if written is not None:
        plans, source = read_external_plans(written), str(written)
    else:
        plans, source = [plan_of_columns(driven(plan)) for plan in result.plans], "plan"
    quantile = 0.5 if result.uncertainty is None else result.uncertainty.quantile
    checked = check_plans(
        plans,
        result.model,
        result.elevation_map,
        clear=clear,
        quantile=quantile,
        source=source,
        quiet=quiet,
    )
    return replace(result, check=checked)


def _around(paths: Sequence[CandidatePath], margin: float) -> tuple[float, float, float, float]:
    points = np.concatenate([path.points for path in paths])
    (x_min, y_min), (x_max, y_max) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(x_min), float(x_max), float(y_min), float(y_max)


def planner_settings(**values: Any) -> PlannerSettings:
    """Settings from options; None keeps the default.

    Raises:
        InputError: names the option.
    """
    stated = {name: value for name, value in values.items() if value is not None}
    with input_errors("", tuple(values)):
        return PlannerSettings(**stated)


def uncertainty_at(quantile: float) -> Uncertainty:
    """Margins at a quantile.

    Raises:
        InputError: names the option.
    """
    with input_errors("", ("quantile",)):
        return Uncertainty(quantile=quantile)
