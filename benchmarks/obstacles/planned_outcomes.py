"""Outcomes of planning over obstacles: passed though too large, or blocked though small."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from slopewise.models.parameters import Model
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.settings import PlannerSettings

from .cases import ObstacleCase, map_of, path_of

TOO_LARGE, SMALL = 1.1, 0.8
"""Sizes from which an obstacle must be blocked, and up to which it must be passed [1]."""

Result = dict[str, Any]


class PlannedOutcome(NamedTuple):
    """A case with the bound that blocks its plan and the reason; None and "" if it is passed."""

    case: ObstacleCase
    blocked_by: Limiting | None
    reason: str


def planned(case: ObstacleCase, model: Model) -> PlannedOutcome:
    """Plan over a case."""
    ground = map_of(case, model.vehicle)
    spacing = PlannerSettings().spacing_on(case.resolution)
    solved = time_optimal_batch(ground, batch([path_of(case, model.vehicle)], spacing), model)
    k = int(solved.bounds.barrier_station[0])
    if k >= int(solved.profile.count[0]):
        return PlannedOutcome(case, None, "")
    blocked_by = Limiting(int(solved.bounds.barrier[0]))
    obstacle = solved.hazards.obstacle(0, k)
    return PlannedOutcome(
        case, blocked_by, blocked_by.label if obstacle is None else obstacle.words
    )


def outcomes(
    cases: Iterable[ObstacleCase],
    models: Mapping[str, Model],
    advance: Callable[[int], Any] | None,
) -> list[PlannedOutcome]:
    """Plan over all cases."""
    results = []
    for case in cases:
        results.append(planned(case, models[case.vehicle]))
        if advance is not None:
            advance(1)
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
    bounds = Counter(o.blocked_by.label for o in results if o.blocked_by is not None)
    return {
        "cases": len(results),
        "too_large": len(large),
        "passed_though_too_large": sum(o.blocked_by is None for o in large),
        "small": len(small),
        "barred_though_small": sum(o.blocked_by is not None for o in small),
        "bars": dict(bounds),
    }
