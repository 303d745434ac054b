"""`slopewise check`: an independent judge of plans, ours or anybody's."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import QUANTILE
from slopewise.services.check.check_report import CheckReport, Violation
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.heights import Heights
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.bags import is_bag
from slopewise.services.io.map_file import map_info, read_map
from slopewise.services.io.map_grid import Around, footprint_margin
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.path_file import check_paths_on_map
from slopewise.services.io.plan_file import read_external_plans


@dataclass(frozen=True, slots=True)
class CheckJob:
    """What to check, as the command line gives it. Lengths in m."""

    plan_file: Path
    map_file: Path
    model_file: str
    clear: float = np.inf
    topics: Path | None = None
    quantile: float = QUANTILE
    nodata: NoData = None


@dataclass(frozen=True, slots=True)
class CheckResult:
    """What was found of each plan, in the file's order; notes: what is assumed of the map."""

    model: str
    reports: tuple[CheckReport, ...]
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """Nothing was found in any of them."""
        return all(report.valid for report in self.reports)

    @property
    def violations(self) -> list[Violation]:
        """Those of all plans."""
        return [violation for report in self.reports for violation in report.violations]


def run(job: CheckJob, *, quiet: bool = False) -> CheckResult:
    """Read and judge.

    Raises:
        InputError: names file and field.
    """
    if job.topics is not None and not is_bag(job.map_file):
        words = "expected a recording with a topic mapping, got files of other kinds"
        raise InputError(str(job.topics), "", words)
    model = read_model(find_model(job.model_file))
    plans = read_external_plans(job.plan_file)
    info = map_info(job.map_file, job.topics)
    check_paths_on_map(
        [_path_of(plan) for plan in plans], info.extent, str(job.plan_file), str(job.map_file)
    )
    around = _around(plans, footprint_margin(model.vehicle, info) + max(model.vehicle.shape[:3]))
    ground = read_map(job.map_file, around=around, topics=job.topics, nodata=job.nodata)
    result = check_all(
        plans,
        model,
        ground,
        job.clear,
        source=str(job.plan_file),
        quiet=quiet,
        quantile=job.quantile,
    )
    return replace(result, notes=ground.assumed)


def check_all(
    plans: Sequence[ExternalPlan],
    model: Model,
    heights: Heights,
    clear: float = np.inf,
    *,
    source: str,
    quiet: bool = False,
    quantile: float = QUANTILE,
) -> CheckResult:
    """Judge plans on ground that is in memory already."""
    begin = time.perf_counter()
    reports = []
    with progress_bar("checking", len(plans), quiet=quiet) as advance:
        for plan in plans:
            try:
                reports.append(
                    check_plan_on_map(plan, model, heights, clear=clear, quantile=quantile)
                )
            except ParameterError as error:
                option = error.field in ("clear", "quantile")
                where = (f"--{error.field}", "") if option else (source, error.field)
                raise InputError(*where, f"expected {error.expected}") from None
            advance(1)
    return CheckResult(model.name, tuple(reports), time.perf_counter() - begin)


def _path_of(plan: ExternalPlan) -> CandidatePath:
    x, y = (np.resize(values, max(len(values), 2)) for values in (plan.x, plan.y))
    return CandidatePath(plan.name, np.stack((x, y), axis=1))


def _around(plans: Sequence[ExternalPlan], margin: float) -> Around:
    x = np.concatenate([plan.x for plan in plans])
    y = np.concatenate([plan.y for plan in plans])
    return (
        float(x.min()) - margin,
        float(x.max()) + margin,
        float(y.min()) - margin,
        float(y.max()) + margin,
    )
