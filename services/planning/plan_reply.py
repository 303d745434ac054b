"""Replies to plan requests from results of the planner; the service adds what they rest on."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, command_of
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.ranking import ranking_cost
from slopewise.planner.plan import Obstacle, SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.units import finite
from slopewise.services.wire import plan_messages as wire

M = TypeVar("M", bound=wire.Message)


def full_stop(reason: str, rejected: list[wire.RankedCandidate] | None = None) -> wire.PlanReply:
    """A full stop, because no candidate can be planned."""
    status = Status.DEGRADED.value
    command, ranking = _copied(wire.WireCommand, FULL_STOP), rejected or []
    return wire.PlanReply(
        status=status, reason=reason, service="", command=command, ranking=ranking
    )


def cycle_reply(answer: CycleAnswer) -> wire.PlanReply:
    """Result of one cycle of a moving horizon."""
    return wire.PlanReply(
        status=answer.status.value,
        reason=answer.reason,
        service="",
        command=_copied(wire.WireCommand, answer.command),
        chosen=None if answer.chosen is None else answer.chosen.candidate,
        kept=answer.kept,
        ranking=[
            wire.RankedCandidate(
                name=r.candidate, usable=r.valid, reason=r.reason, cost=finite(r.cost)
            )
            for r in answer.ranking
        ],
        plans=[_plan(plan) for plan in answer.plans],
        seconds={f"planner.{stage}": seconds for stage, seconds in answer.seconds.items()},
    )


def ranked_reply(
    plans: list[SpeedPlan],
    settings: PlannerSettings,
    period: float,
    rejected: list[wire.RankedCandidate],
) -> wire.PlanReply:
    """Result of a request without a client; plans are best first, ``period`` to the next [s]."""
    best = plans[0]
    is_stop = best.status is Status.INFEASIBLE
    command = FULL_STOP if is_stop else command_of(best, 0.0, 0.0, period)
    ranking = [
        wire.RankedCandidate(
            name=plan.candidate,
            usable=plan.status is not Status.INFEASIBLE,
            reason=plan.reason,
            cost=ranking_cost(plan, settings),
        )
        for plan in plans
    ]
    return wire.PlanReply(
        status=best.status.value,
        reason=best.reason,
        service="",
        command=_copied(wire.WireCommand, command),
        chosen=best.candidate,
        ranking=[*ranking, *rejected],
        plans=[_plan(plan) for plan in plans],
    )


def _plan(plan: SpeedPlan) -> wire.Plan:
    changes = np.flatnonzero(np.diff(plan.limiting)) + 1
    starts, deviation = [0, *(int(i) for i in changes)], plan.path_deviation
    return wire.Plan(
        candidate=plan.candidate,
        status=plan.status.value,
        reason=plan.reason,
        travel_time=plan.travel_time,
        progress=plan.progress,
        clear_distance=float(plan.clear_distance),
        least_margin=finite(plan.least_margin),
        least_rear_load=float(plan.rear_load.min()),
        limits=[wire.Limit(first=i, name=Limiting(int(plan.limiting[i])).label) for i in starts],
        columns=list(wire.PLAN_COLUMNS),
        values=np.stack([getattr(plan, name) for name in wire.PLAN_COLUMNS]),
        obstacle=_obstacle(plan.obstacle),
        path_deviation=None if deviation is None else _copied(wire.Deviation, deviation),
    )


def _copied(kind: type[M], value: object) -> M:
    """A message with the values of an object that has the same fields."""
    return kind(**{name: getattr(value, name) for name in kind.__struct_fields__})


def _obstacle(obstacle: Obstacle | None) -> wire.ObstacleMessage | None:
    if obstacle is None:
        return None
    return wire.ObstacleMessage(
        bound=obstacle.bound.label,
        x=float(obstacle.x),
        y=float(obstacle.y),
        height=float(obstacle.height),
        words=obstacle.words,
    )
