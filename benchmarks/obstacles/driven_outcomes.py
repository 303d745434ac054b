"""Obstacles driven in the physics engine: plans that are ok, and what would have been without."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import Status

from .cases import map_of, path_of
from .drive import Driven, drive
from .screening import Outcome, must_bar

Result = dict[str, Any]


class Driving(NamedTuple):
    """One drive.

    Attributes:
        outcome: what the plan made of the case.
        passed: the plan is ok and was driven; else the way was barred, and the vehicle was driven
            as fast as it would have been without the obstacle.
        driven: what happened.
    """

    outcome: Outcome
    passed: bool
    driven: Driven


def driven(outcome: Outcome, model: Model, built: Model) -> Driving | None:
    """Drive a case; None if there is no plan for its ground even without the obstacle.

    Args:
        outcome: of the case. model: that plans are made with. built: that the engine's vehicle is
            built from.
    """
    case, planner = outcome.case, CandidatePlanner(model)
    path = path_of(case, model.vehicle)
    (plan,) = planner.plan(map_of(case, model.vehicle), [path])
    passed = plan.status is Status.OK
    if not passed:
        (plan,) = planner.plan(map_of(case, model.vehicle, empty=True), [path])
        if plan.status is not Status.OK:
            return None
    return Driving(outcome, passed, drive(case.block, case.slope, built, plan))


def drives(
    found: list[Outcome],
    models: Mapping[str, Model],
    built: Mapping[str, Model],
    wanted: int,
    progress: Callable[[int], None] | None,
) -> list[Driving]:
    """Half of them of plans that are ok, half of ways that are barred, in turn as they come."""
    passed = [o for o in found if o.bar is None]
    barred = [o for o in found if o.bar is not None]
    out: list[Driving] = []
    for some in (passed, barred):
        done = 0
        for outcome in some:
            if done == wanted // 2:
                break
            name = outcome.case.vehicle
            driving = driven(outcome, models[name], built[name])
            if driving is None:
                continue
            done += 1
            out.append(driving)
            if progress is not None:
                progress(1)
    return out


def summary(all_driven: list[Driving]) -> Result:
    """What became of them; plain data, ready for JSON."""
    passed = [d for d in all_driven if d.passed]
    barred = [d for d in all_driven if not d.passed]
    large = [d for d in barred if must_bar(d.outcome.case)]
    return {"passed": _row(passed), "barred": _row(barred), "barred_too_large": _row(large)}


def _row(some: list[Driving]) -> Result:
    return {
        "drives": len(some),
        "struck": sum(d.driven.struck for d in some),
        "tipped": sum(d.driven.tipped for d in some),
        "wheel_in_the_air": sum(d.driven.air > 0.2 for d in some),
        "stuck": sum(d.driven.stuck for d in some),
        "failed": sum(d.driven.failed for d in some),
    }
