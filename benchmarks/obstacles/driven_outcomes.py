"""Obstacles driven in the physics engine, by plans that pass them and without regard to blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import Status

from .cases import map_of, path_of
from .obstacle_drive import MAX_AIR, Driven, drive
from .planned_outcomes import PlannedOutcome, must_block

Result = dict[str, Any]


class DrivenOutcome(NamedTuple):
    """One drive.

    Attributes:
        outcome: planned outcome of the case.
        passed: whether its plan is ok and was driven; else the path was blocked, and the vehicle
            was driven as fast as without the obstacle.
        driven: outcome of the drive.
    """

    outcome: PlannedOutcome
    passed: bool
    driven: Driven


def drive_case(outcome: PlannedOutcome, model: Model, built: Model) -> DrivenOutcome | None:
    """Drive a case; None if its ground has no plan even without the obstacle.

    Args:
        outcome: planned outcome of the case.
        model: model for plans.
        built: model that the engine's vehicle is built from.
    """
    case, planner = outcome.case, CandidatePlanner(model)
    path = path_of(case, model.vehicle)
    (plan,) = planner.plan(map_of(case, model.vehicle), [path])
    passed = plan.status is Status.OK
    if not passed:
        (plan,) = planner.plan(map_of(case, model.vehicle, empty=True), [path])
        if plan.status is not Status.OK:
            return None
    return DrivenOutcome(outcome, passed, drive(case.block, case.slope, built, plan))


def drives(
    planned: list[PlannedOutcome],
    models: Mapping[str, Model],
    built: Mapping[str, Model],
    count: int,
    advance: Callable[[int], Any] | None,
) -> list[DrivenOutcome]:
    """Drive half of the count over passed obstacles, half over blocked ones, in their order."""
    results: list[DrivenOutcome] = []
    for blocked in (False, True):
        group = [o for o in planned if (o.blocked_by is not None) is blocked]
        finished = 0
        for outcome in group:
            if finished == count // 2:
                break
            name = outcome.case.vehicle
            result = drive_case(outcome, models[name], built[name])
            if result is None:
                continue
            finished += 1
            results.append(result)
            if advance is not None:
                advance(1)
    return results


def summary(results: list[DrivenOutcome]) -> Result:
    """Counts of failures, as plain data."""
    passed = [r.driven for r in results if r.passed]
    blocked = [r for r in results if not r.passed]
    large = [r.driven for r in blocked if must_block(r.outcome.case)]
    return {
        "passed": _row(passed),
        "barred": _row([r.driven for r in blocked]),
        "barred_too_large": _row(large),
    }


def _row(group: list[Driven]) -> Result:
    return {
        "drives": len(group),
        "struck": sum(d.struck for d in group),
        "tipped": sum(d.tipped for d in group),
        "wheel_in_the_air": sum(d.air > MAX_AIR for d in group),
        "stuck": sum(d.stuck for d in group),
        "failed": sum(d.failed for d in group),
    }
