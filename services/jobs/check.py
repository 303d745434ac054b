"""Check plans of any planner on a map, independently of how they were made."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import QUANTILE
from slopewise.services.check.check_report import CheckReport
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.plan_file import read_external_plans
from slopewise.services.io.units import finite
from slopewise.services.jobs.ground import read_ground, refuse_topics
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary, input_errors


class ViolationRow(Summary, frozen=True):
    """A violation; `size` is null where it has no end."""

    candidate: str
    row: int
    station: float
    kind: str
    size: float | None
    unit: str
    sentence: str


class CheckedPlan(Summary, frozen=True):
    """A plan in one row; `kinds` counts its violations by kind.

    `refused_for` is the worst of its violations, null without one; `verified` and `unverified` are
    the columns that were compared, and those that were not.
    """

    candidate: str
    status: str
    valid: bool
    stations: int
    stops: int
    kinds: dict[str, int]
    refused_for: str | None
    verified: list[str]
    unverified: list[str]
    notes: list[str]


class ToleranceRow(Summary, frozen=True):
    """A difference that is not yet a violation, and its reason."""

    value: float
    unit: str
    meaning: str
    rationale: str = msgspec.field(name="why")


class CheckSummary(Summary, frozen=True):
    """Output of `check --json`."""

    model: str
    valid: bool
    seconds: float
    notes: list[str]
    violations: list[ViolationRow]
    plans: list[CheckedPlan]
    tolerances: dict[str, ToleranceRow]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Reports of all plans in the file's order; notes: assumptions about the map."""

    model: str
    reports: tuple[CheckReport, ...]
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """True if no plan has a violation."""
        return all(report.valid for report in self.reports)

    @property
    def summary(self) -> CheckSummary:
        """The result as JSON has it."""
        violations = [v for report in self.reports for v in report.violations]
        return CheckSummary.of(
            self,
            violations=[ViolationRow.of(v, size=finite(v.size)) for v in violations],
            plans=[_checked(report) for report in self.reports],
            tolerances={kind: ToleranceRow.of(t) for kind, t in TOLERANCES.items()},
        )


def _checked(report: CheckReport) -> CheckedPlan:
    kinds = dict(Counter(violation.kind for violation in report.violations))
    return CheckedPlan.of(report, stations=len(report.station), kinds=kinds)


def check(
    plan_file: Path,
    map_file: Path,
    model_file: str,
    *,
    clear: float = np.inf,
    quantile: float = QUANTILE,
    topics: Path | None = None,
    nodata: NoData = None,
) -> CheckResult:
    """Read plans, model and map, and check every plan; `clear` in metres, as `nodata`."""
    refuse_topics(topics, map_file)
    model = read_model(find_model(model_file))
    plans = read_external_plans(plan_file)
    paths = [_path_of(plan) for plan in plans]
    reach = max(model.vehicle.shape[:3])
    ground = read_ground(
        map_file, paths, plan_file, model.vehicle, topics=topics, nodata=nodata, reach=reach
    )
    result = check_plans(
        plans, model, ground, clear=clear, quantile=quantile, source=str(plan_file)
    )
    return replace(result, notes=ground.assumed)


def check_plans(
    plans: Sequence[ExternalPlan],
    model: Model,
    heights: ElevationMap,
    *,
    clear: float,
    quantile: float,
    source: str,
) -> CheckResult:
    """Check plans on ground that is in memory."""
    begin = time.perf_counter()
    reports = []
    with progress_bar("checking", len(plans)) as advance:
        for plan in plans:
            with input_errors(source, ("clear", "quantile")):
                reports.append(
                    check_plan_on_map(plan, model, heights, clear=clear, quantile=quantile)
                )
            advance(1)
    return CheckResult(model.name, tuple(reports), time.perf_counter() - begin)


def _path_of(plan: ExternalPlan) -> CandidatePath:
    x, y = (np.resize(values, max(len(values), 2)) for values in (plan.x, plan.y))
    return CandidatePath(plan.name, np.stack((x, y), axis=1))
