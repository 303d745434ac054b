"""Obstacles around the limits of two vehicles: planned over, compared with their geometry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rich.console import Console

from slopewise.models.parameters import Model
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.settings import PlannerSettings

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import shipped
from ..common.text_tables import table_of
from ..common.timing import machine, timed
from .cases import ObstacleCase, cases, map_of, path_of

CASES, QUICK_CASES = 2400, 240  # of a whole and of a quick run [1]
VEHICLES = ("atv", "husky")
TOO_LARGE, SMALL = 1.1, 0.8  # sizes from which it must be blocked, up to which passed [1]
_SEED = 23  # of the cases


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    count = QUICK_CASES if request.quick else CASES
    models = {name: shipped(name) for name in VEHICLES}
    drawn_cases = tracked(progress, "obstacles", list(cases(count, models, _SEED)))
    seconds, planned = timed(lambda: outcomes(drawn_cases, models))
    return {
        "quick": request.quick,
        "machine": machine(),
        "vehicles": list(VEHICLES),
        "planned": {"seconds": seconds, **summary(planned)},
    }


class PlannedOutcome(NamedTuple):
    """A case, and whether its obstacle blocks the path."""

    case: ObstacleCase
    is_blocked: bool


def outcomes(cases: Iterable[ObstacleCase], models: Mapping[str, Model]) -> list[PlannedOutcome]:
    results = []
    for case in cases:
        model = models[case.vehicle]
        spacing = PlannerSettings().spacing_on(case.resolution, model.vehicle)
        path = batch([path_of(case, model.vehicle)], spacing)
        solved = time_optimal_batch(map_of(case, model.vehicle), path, model)
        is_blocked = solved.bounds.barrier_station[0] < solved.profile.count[0]
        results.append(PlannedOutcome(case, bool(is_blocked)))
    return results


def must_block(case: ObstacleCase) -> bool:
    """Whether the obstacle is certainly too large."""
    return case.certain.largest >= TOO_LARGE


def must_pass(case: ObstacleCase) -> bool:
    """Whether the obstacle is small in any case."""
    return case.possible.largest <= SMALL


def summary(results: list[PlannedOutcome]) -> Result:
    """Counts of each kind and of all, as plain data."""
    kinds = sorted({outcome.case.kind for outcome in results})
    rows = {kind: _row([o for o in results if o.case.kind == kind]) for kind in kinds}
    return {"kinds": rows, "all": _row(results)}


def _row(results: list[PlannedOutcome]) -> Result:
    large = [o for o in results if must_block(o.case)]
    small = [o for o in results if must_pass(o.case)]
    return {
        "cases": len(results),
        "too_large": len(large),
        "passed_though_too_large": sum(not o.is_blocked for o in large),
        "small": len(small),
        "barred_though_small": sum(o.is_blocked for o in small),
    }


def show(result: Result, console: Console) -> None:
    planned = result["planned"]
    titles = ("cases", "too large", "of these passed", "small", "of these blocked")
    keys = ("cases", "too_large", "passed_though_too_large", "small", "barred_though_small")
    table = table_of(f"obstacles: {planned['all']['cases']} planned", *titles, first="kind")
    for kind, row in {**planned["kinds"], "all": planned["all"]}.items():
        table.add_row(kind, *(str(row[key]) for key in keys))
    console.print(table)
