"""Cost of a plan: the one ranking of `slopewise plan`, of the moving horizon and of the service.

All weights are those of :class:`slopewise.planner.settings.PlannerSettings`. A time-optimal profile
has no margin yet, so a batch is ordered by
`travel_cost` of the core alone, which is :func:`travel_cost` of
this module before the plan is finished.
"""

from __future__ import annotations

from collections.abc import Sequence

from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings


def travel_cost(plan: SpeedPlan, settings: PlannerSettings) -> float:
    """Travel time, and what each metre of the path that is not reached is charged [s]."""
    missed = float(plan.station[-1]) - plan.progress
    return plan.travel_time + settings.horizon_penalty * missed


def ranking_cost(plan: SpeedPlan, settings: PlannerSettings) -> float:
    """Travel cost less what the spare clear distance is worth [s]."""
    margin = max(min(plan.least_margin, settings.margin_enough), 0.0)
    return travel_cost(plan, settings) - settings.margin_weight * margin


def rank(plans: Sequence[SpeedPlan], settings: PlannerSettings) -> list[SpeedPlan]:
    """Plans best first: what may be driven, then the cheapest, then the wider margin."""

    def key(plan: SpeedPlan) -> tuple[bool, bool, float, float]:
        fallback = plan.status is Status.DEGRADED
        return not plan.admissible, fallback, ranking_cost(plan, settings), -plan.least_margin

    return sorted(plans, key=key)
