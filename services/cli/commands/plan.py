"""`slopewise plan`: candidate paths over an elevation map to ranked, verified speed plans."""

from __future__ import annotations

import dataclasses
import itertools
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.explain.explain import Explanation, explain
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import EvenPath
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.ranking import rank
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.sentences import notes
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.cli.commands.check import CheckResult, check_all
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.bags import is_bag
from slopewise.services.io.map_file import frame_of, map_info, read_map
from slopewise.services.io.map_grid import footprint_margin
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map, read_paths
from slopewise.services.io.plan_file import driven, read_external_plans, write_plan_csv
from slopewise.services.planning.cold_start import sooner, stations_of

_SCENES = (".mcap", ".rrd")
"""Files to look at; all else is CSV."""

_OTHERS = (".xlsx", ".xls", ".ods", ".parquet", ".json", ".npz", ".tif", ".toml", ".html", ".pdf")
"""Names that promise what a table of text is not."""


@dataclass(frozen=True, slots=True)
class PlanJob:
    """What to plan, as the command line gives it. Speeds in m/s, lengths in m."""

    map_file: Path
    path_file: Path
    model_file: str
    start_speed: float = 0.0
    clear: float = np.inf
    settings: PlannerSettings = field(default_factory=PlannerSettings)
    uncertainty: Uncertainty | None = field(default_factory=Uncertainty)
    explain: bool = False
    topics: Path | None = None
    nodata: NoData = None


@dataclass(frozen=True, slots=True)
class MadeFrom:
    """Files of map and model, as they were found."""

    map_file: Path
    model_file: Path


@dataclass(frozen=True, slots=True)
class PlanResult:
    """Plans best first, and what they were made from; `made_from`: the files, if there are any."""

    plans: list[SpeedPlan]
    elevation_map: ElevationMap
    model: Model
    seconds: float
    uncertainty: Uncertainty | None = None
    explanation: Explanation | None = None
    check: CheckResult | None = None
    made_from: MadeFrom | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What is assumed of the map, what it cannot show, and numbers that are assumed."""
        ground, limits = self.elevation_map, self.model.limits
        told = (*ground.assumed, *notes(self.model.vehicle, ground.resolution))
        if limits.max_path_deviation is not None:
            return told
        limit = f"{self.model.max_path_deviation:.3g} m from a given path"
        return *told, f"assumed from the vehicle's width: plans lead at most {limit}"

    @property
    def admissible(self) -> bool:
        """At least one plan may be driven and leads somewhere."""
        return any(plan.admissible for plan in self.plans)


def run(job: PlanJob, *, quiet: bool = False) -> PlanResult:
    """Read, plan, rank.

    Raises:
        InputError: names file and field.
    """
    model_file = find_model(job.model_file)
    model = read_model(model_file)
    topics = _topics(job)
    paths = read_paths(job.path_file, topics, frame_of(job.map_file, topics))
    info = map_info(job.map_file, topics)
    check_paths_on_map(paths, info.extent, str(job.path_file), str(job.map_file))
    margin = footprint_margin(model.vehicle, info)
    elevation_map = read_map(
        job.map_file, around=_around(paths, margin), topics=topics, nodata=job.nodata
    )
    result = plan_on(elevation_map, paths, model, job, source=str(job.path_file), quiet=quiet)
    return dataclasses.replace(result, made_from=MadeFrom(job.map_file, model_file))


def plan_on(
    elevation_map: ElevationMap,
    paths: list[CandidatePath],
    model: Model,
    job: PlanJob,
    *,
    source: str,
    quiet: bool = False,
) -> PlanResult:
    """Plan and rank on ground that is in memory already; the job gives speed, clear, settings."""
    planner = CandidatePlanner(model, job.settings, job.uncertainty)

    def planned() -> tuple[list[EvenPath], list[SpeedPlan], float]:
        begin = time.perf_counter()
        with progress_bar("planning", len(paths), quiet=quiet) as advance:
            even = planner.resampled(elevation_map, paths)
            plans = planner.plan(
                elevation_map,
                even,
                start_speed=job.start_speed,
                clear=job.clear,
                progress=advance,
            )
        return even, plans, time.perf_counter() - begin

    spacing = job.settings.spacing_on(elevation_map.resolution)
    try:
        even, plans, seconds = sooner(planned, lambda: stations_of(paths, spacing))
    except ParameterError as error:
        option = error.field in ("speed", "clear")
        where = (f"--{error.field}", "") if option else (source, error.field)
        raise InputError(*where, f"expected {error.expected}") from None
    ranked = rank(plans, job.settings)
    explanation = None
    if job.explain:
        best = next(path for path in even if path.name == ranked[0].candidate)
        explanation = explain(
            model,
            elevation_map,
            best,
            settings=job.settings,
            uncertainty=job.uncertainty,
            start_speed=job.start_speed,
            clear=job.clear,
        )
    return PlanResult(ranked, elevation_map, model, seconds, job.uncertainty, explanation)


def checked(
    result: PlanResult, written: Path | None, clear: float | None, *, quiet: bool = False
) -> PlanResult:
    """The result with the word of the independent judge, of the file where a CSV was written."""
    if written is not None and written.suffix.lower() not in _SCENES:
        plans, source = read_external_plans(written), str(written)
    else:
        plans, source = [plan_of_columns(driven(plan)) for plan in result.plans], "plan"
    reach = np.inf if clear is None else clear
    told = 0.5 if result.uncertainty is None else result.uncertainty.quantile
    found = check_all(
        plans, result.model, result.elevation_map, reach, source=source, quiet=quiet, quantile=told
    )
    return dataclasses.replace(result, check=found)


def _topics(job: PlanJob) -> Path | None:
    if job.topics is not None and not (is_bag(job.map_file) or is_bag(job.path_file)):
        words = "expected a recording with a topic mapping, got files of other kinds"
        raise InputError(str(job.topics), "", words)
    return job.topics


def _around(paths: list[CandidatePath], margin: float) -> tuple[float, float, float, float]:
    points = np.concatenate([path.points for path in paths])
    (x_min, y_min), (x_max, y_max) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(x_min), float(x_max), float(y_min), float(y_max)


def check_out(path: Path | None) -> None:
    """Raise InputError for a name that promises another kind of file than a table or a scene."""
    if path is not None and path.suffix.lower() in _OTHERS:
        words = f"expected a name that ends in .csv, {' or '.join(_SCENES)}, got {path.suffix}"
        raise InputError(str(path), "", words)


def write(result: PlanResult, path: Path) -> None:
    """All plans, best first, in the format that the name asks for: .mcap, .rrd, else CSV."""
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        from slopewise.services.scene.foxglove_file import write_mcap

        write_mcap(path, result.elevation_map, result.plans, result.model.vehicle)
    elif suffix == ".rrd":
        from slopewise.services.scene.rerun_file import write_rrd

        write_rrd(path, result.elevation_map, result.plans, result.model.vehicle)
    else:
        write_csv(result, path)


def write_csv(result: PlanResult, path: Path) -> None:
    """All plans in one file, best first."""
    parts = [driven(plan) for plan in result.plans]
    joined: dict[str, Any] = {}
    for name in parts[0]:
        values = [part[name] for part in parts]
        texts = isinstance(values[0], list)
        joined[name] = list(itertools.chain(*values)) if texts else np.concatenate(values)
    write_plan_csv(joined, path)


def uncertainty_at(quantile: float) -> Uncertainty:
    """What plans survive at a quantile."""
    try:
        return Uncertainty(quantile=quantile)
    except ParameterError as error:
        raise InputError("--quantile", "", f"expected {error.expected}") from None


def settings_of(smooth: bool, **given: Any) -> PlannerSettings:
    """Settings by their names; what is None keeps its default.

    Raises:
        InputError: names the option.
    """
    values = {name: value for name, value in given.items() if value is not None}
    try:
        return PlannerSettings(smooth=smooth, **values)
    except ParameterError as error:
        option = f"--{error.field.replace('_', '-')}"
        raise InputError(option, "", f"expected {error.expected}") from None
