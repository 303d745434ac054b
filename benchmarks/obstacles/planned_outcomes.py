"""What plans make of obstacles: passed though too high, or barred though low."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from slopewise.models.parameters import Model
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.settings import PlannerSettings

from .cases import Case, map_of, path_of

TOO_LARGE, SMALL = 1.1, 0.8
"""Obstacles at least so large must be barred; at most so small they should be passed."""

Result = dict[str, Any]


class Outcome(NamedTuple):
    """What a plan made of a case: the bound that ends it, and why; none if it is passed."""

    case: Case
    bar: Limiting | None
    why: str


def planned(case: Case, model: Model) -> Outcome:
    """Plan over a case."""
    ground = map_of(case, model.vehicle)
    spacing = PlannerSettings().spacing_on(case.resolution)
    solved = time_optimal_batch(ground, batch([path_of(case, model.vehicle)], spacing), model)
    k = int(solved.bounds.barrier_station[0])
    if k >= int(solved.profile.count[0]):
        return Outcome(case, None, "")
    bar = Limiting(int(solved.bounds.barrier[0]))
    met = solved.hazards.obstacle(0, k)
    return Outcome(case, bar, bar.label if met is None else met.words)


def outcomes(
    drawn: Iterable[Case], models: Mapping[str, Model], progress: Callable[[int], None] | None
) -> list[Outcome]:
    """All of them planned."""
    found = []
    for case in drawn:
        found.append(planned(case, models[case.vehicle]))
        if progress is not None:
            progress(1)
    return found


def must_bar(case: Case) -> bool:
    """It is there for sure and too large."""
    return case.sure.worst >= TOO_LARGE


def should_pass(case: Case) -> bool:
    """Whatever of it there may be is small."""
    return case.possible.worst <= SMALL


def summary(found: list[Outcome]) -> Result:
    """Counts of each kind and of all; plain data, ready for JSON."""
    kinds = sorted({outcome.case.kind for outcome in found})
    rows = {kind: _row([o for o in found if o.case.kind == kind]) for kind in kinds}
    return {"kinds": rows, "all": _row(found)}


def _row(found: list[Outcome]) -> Result:
    large = [o for o in found if must_bar(o.case)]
    small = [o for o in found if should_pass(o.case)]
    bars = Counter(o.bar.label for o in found if o.bar is not None)
    return {
        "cases": len(found),
        "too_large": len(large),
        "passed_though_too_large": sum(o.bar is None for o in large),
        "small": len(small),
        "barred_though_small": sum(o.bar is not None for o in small),
        "bars": dict(bars),
    }
