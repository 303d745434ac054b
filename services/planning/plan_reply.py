"""Replies to plan requests from results of the planner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, SpeedCommand
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.ranking import ranking_cost
from slopewise.planner.plan import Obstacle, SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.wire.messages import (
    PLAN_COLUMNS,
    Deviation,
    Limit,
    Met,
    Plan,
    RankedCandidate,
    WireCommand,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanResult:
    """Result of one request as messages; by default a full stop without a plan.

    Attributes:
        chosen: name of the candidate to drive; None: the reply is a stop.
        reused: the plan driven so far is continued unchanged. seconds: duration of stages.
    """

    reason: str
    status: str = Status.DEGRADED.value
    command: WireCommand
    chosen: str | None = None
    reused: bool = False
    ranking: list[RankedCandidate]
    plans: list[Plan]
    seconds: dict[str, float]


def full_stop(reason: str, rejected: list[RankedCandidate] | None = None) -> PlanResult:
    """A full stop, because no candidate can be planned."""
    return PlanResult(
        reason=reason, command=_command(FULL_STOP), ranking=rejected or [], plans=[], seconds={}
    )


def cycle_result(answer: CycleAnswer) -> PlanResult:
    """Result of one cycle of a moving horizon."""
    return PlanResult(
        status=answer.status.value,
        reason=answer.reason,
        command=_command(answer.command),
        chosen=None if answer.chosen is None else answer.chosen.candidate,
        reused=answer.kept,
        ranking=[
            RankedCandidate(name=r.candidate, usable=r.valid, reason=r.reason, cost=finite(r.cost))
            for r in answer.ranking
        ],
        plans=[plan_message(plan) for plan in answer.plans],
        seconds={f"planner.{stage}": seconds for stage, seconds in answer.seconds.items()},
    )


def ranked_result(
    plans: list[SpeedPlan],
    command: SpeedCommand,
    settings: PlannerSettings,
    rejected: list[RankedCandidate],
) -> PlanResult:
    """Result of a request without a client; ``plans``: best first, at least one."""
    best = plans[0]
    ranking = [
        RankedCandidate(
            name=plan.candidate,
            usable=plan.status is not Status.INFEASIBLE,
            reason=plan.reason,
            cost=ranking_cost(plan, settings),
        )
        for plan in plans
    ]
    return PlanResult(
        status=best.status.value,
        reason=best.reason,
        command=_command(command),
        chosen=best.candidate,
        ranking=[*ranking, *rejected],
        plans=[plan_message(plan) for plan in plans],
        seconds={},
    )


def plan_message(plan: SpeedPlan) -> Plan:
    """A plan as a message."""
    changes = np.flatnonzero(np.diff(plan.limiting)) + 1
    starts = [0, *(int(i) for i in changes)]
    return Plan(
        candidate=plan.candidate,
        status=plan.status.value,
        reason=plan.reason,
        travel_time=plan.travel_time,
        progress=plan.progress,
        clear_distance=float(plan.clear_distance),
        least_margin=finite(plan.least_margin),
        least_rear_load=float(plan.rear_load.min()),
        limits=[Limit(first=i, name=Limiting(int(plan.limiting[i])).label) for i in starts],
        columns=list(PLAN_COLUMNS),
        values=np.stack([getattr(plan, name) for name in PLAN_COLUMNS]),
        obstacle=_obstacle(plan.obstacle),
        path_deviation=_deviation(plan),
    )


def finite(value: float) -> float | None:
    """The value as a number of a message; None if it is not finite."""
    return float(value) if np.isfinite(value) else None


def _command(command: SpeedCommand) -> WireCommand:
    return WireCommand(
        speed=command.speed, accel=command.accel, stop=command.stop, valid_for=command.valid_for
    )


def _deviation(plan: SpeedPlan) -> Deviation | None:
    deviation = plan.path_deviation
    if deviation is None:
        return None
    return Deviation(
        largest=deviation.largest,
        station=deviation.station,
        x=deviation.x,
        y=deviation.y,
        limit=deviation.limit,
    )


def _obstacle(obstacle: Obstacle | None) -> Met | None:
    if obstacle is None:
        return None
    return Met(
        bound=obstacle.bound.label,
        x=float(obstacle.x),
        y=float(obstacle.y),
        height=float(obstacle.height),
        words=obstacle.words,
    )
