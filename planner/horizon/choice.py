"""Which of the finished plans is driven, and the command to the vehicle."""

from __future__ import annotations

from dataclasses import replace

from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, Deficit, Ranked, command_of
from slopewise.planner.horizon.cycle_planner import CyclePlanner
from slopewise.planner.horizon.previous_plan import PreviousPlan
from slopewise.planner.pipeline.ranking import ranking_cost
from slopewise.planner.plan import SpeedPlan, Status

SAFE = (Status.OK, Status.BLOCKED)

_STARTS = 0.05
"""A plan slower than the vehicle by this does not begin at the vehicle [m/s]."""


def best_first(
    planner: CyclePlanner,
    plans: list[PreviousPlan],
    continued: PreviousPlan | None,
    previous: str,
    gain: float,
) -> list[PreviousPlan]:
    """Plans by what is safe, as requested, and soon there.

    Args:
        planner: this cycle's. plans: the finished ones.
        continued: the one among them that continues the previous plan, if any does.
        previous: name of its path. gain: by how much another has to be better than it [s].
    """
    state = planner.state
    # Want of smoothing is no reason to stand.
    is_standing = continued is not None and not continued.plan.speed.any()

    def key(plan: PreviousPlan) -> tuple[bool, bool, float]:
        is_previous = plan.plan.candidate == previous
        if plan.plan.status is Status.INFEASIBLE:
            return True, not is_previous, 0.0
        cost = ranking_cost(plan.plan, planner.planning)
        if is_previous:
            # It begins behind the vehicle.
            projection = plan.locate((state.x, state.y), state.heading)
            cost -= plan.time_at(projection) + gain
        return False, plan.plan.status is Status.DEGRADED and not is_standing, cost

    plans = sorted(plans, key=key)
    if continued is not None and continued.plan.status is Status.OK:
        # What reaches its end is replaced only by what does so as well.
        plans.sort(key=lambda plan: plan.plan.status is not Status.OK)
    return plans


def answer(
    planner: CyclePlanner,
    best: PreviousPlan,
    plans: tuple[SpeedPlan, ...],
    ranking: tuple[Ranked, ...],
    lead: float,
    deficit: Deficit | None = None,
    unchanged: bool = False,
) -> tuple[CycleAnswer, PreviousPlan | None]:
    """The answer that drives a plan; and that plan, None if it must not be driven.

    Args:
        best: plan to drive. plans, ranking, deficit: as in the answer; unchanged: its ``kept``.
        lead: how much later than measured, by its plan, the vehicle is by now [s].
    """
    plan, state = best.plan, planner.state
    projection = best.locate((state.x, state.y), state.heading)
    reason = plan.reason
    if deficit is not None and plan.status not in SAFE:
        reason = f"{reason}; the plan so far lacks {deficit.sentence()}"
    planned, _ = best.speed_at(projection)
    too_slow = max(state.speed, 0.0) - planned > max(_STARTS, planner.settings.speed_error)
    if plan.status is Status.INFEASIBLE or too_slow:
        status = Status.INFEASIBLE
        return CycleAnswer(status, reason, plan, FULL_STOP, plans, ranking, deficit), None
    measured, tracking = best.time_at(projection), planner.model.tracking
    # Where braking for what was just seen begins late, it has to catch up.
    late = state.age if planned > 0.0 else lead
    late += 0.0 if tracking is None else tracking.latency
    command = command_of(plan, measured + lead, measured + late, planner.settings.period)
    best = replace(best, measured=measured, lead=lead)
    return CycleAnswer(plan.status, reason, plan, command, plans, ranking, deficit, unchanged), best
