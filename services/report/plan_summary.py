"""What a page says of each plan in a row of its table, and of all of them in a sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan, Status

_HOW = (
    (Status.OK, "reaches the end of its path", "reach the end of their paths"),
    (Status.BLOCKED, "stops short of the end of its path", "stop short of the end of their paths"),
    (Status.DEGRADED, "needs a fallback", "need a fallback"),
    (Status.INFEASIBLE, "is infeasible", "are infeasible"),
)


@dataclass(frozen=True, slots=True)
class PlanSummary:
    """One plan in numbers; None is "there is none", e.g. no margin of a plan that never moves.

    Attributes:
        rank: 1 is best.
        name, status, reason: of the plan.
        travel_time: until the last movement ends [s].
        progress, length: where it comes to rest, and where the path ends [m].
        mean_speed, max_speed: [m/s].
        margin: least distance that an emergency stop leaves of the clear distance [m].
        rear_load, side_load: least in any emergency stop, shares of the level static loads.
        limits_most: what limits along most of the driven way.
        limits_share: share of the driven way along which it does.
        path_deviation: how far the plan leads from the path that was given at most [m].
    """

    rank: int
    name: str
    status: Status
    reason: str
    travel_time: float | None
    progress: float
    length: float
    mean_speed: float | None
    max_speed: float | None
    margin: float | None
    rear_load: float | None
    side_load: float | None
    limits_most: Limiting | None
    limits_share: float
    path_deviation: float | None


def summarise(plan: SpeedPlan, rank: int) -> PlanSummary:
    """Numbers of one plan."""
    moving = plan.speed > 0.0
    last = min(int(np.flatnonzero(moving)[-1]) + 1, len(moving) - 1) if moving.any() else 0
    driven = slice(0, last + 1)
    limits_most, limits_share = _limits_most(plan, last)
    time = _finite(plan.travel_time)
    with np.errstate(invalid="ignore"):  # inf - inf, where nothing limits
        margin = _finite(plan.least_margin)
    return PlanSummary(
        rank=rank,
        name=plan.candidate,
        status=plan.status,
        reason=plan.reason,
        travel_time=time,
        progress=plan.progress,
        length=float(plan.station[-1]),
        mean_speed=plan.progress / time if time else None,
        max_speed=_finite(np.max(plan.speed)),
        margin=margin,
        rear_load=_least(plan.rear_load[driven]),
        side_load=_least(plan.side_load[driven]),
        limits_most=limits_most,
        limits_share=limits_share,
        path_deviation=None if plan.path_deviation is None else plan.path_deviation.largest,
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _least(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else None


def _limits_most(plan: SpeedPlan, last: int) -> tuple[Limiting | None, float]:
    """Longest share of the driven way; what holds at a station holds up to the next."""
    if last == 0:
        return None, 0.0
    lengths = np.bincount(
        plan.limiting[:last], weights=np.diff(plan.station[: last + 1]), minlength=len(Limiting)
    )
    most = int(lengths.argmax())
    return Limiting(most), float(lengths[most] / lengths.sum())


def chosen(plans: Sequence[SpeedPlan]) -> int | None:
    """Index of the best ranked plan that may be driven; None if there is none."""
    return next((i for i, plan in enumerate(plans) if plan.admissible), None)


def verdict(plans: Sequence[SpeedPlan]) -> str:
    """How the planning went, in one or two sentences."""
    if not plans:
        return "There was no candidate to plan."
    count = Counter(plan.status for plan in plans)
    said = [
        f"{count[status]} {one if count[status] == 1 else many}"
        for status, one, many in _HOW
        if count[status]
    ]
    if len(said) > 1:
        if count[Status.OK] and count[Status.BLOCKED]:
            short = count[Status.BLOCKED]
            said[1] = f"{short} {'stops' if short == 1 else 'stop'} short of it"
        return f"Of {len(plans)} candidates, {', '.join(said[:-1])} and {said[-1]}."
    _, one, many = next(how for how in _HOW if count[how[0]])
    return f"All {len(plans)} candidates {many}." if len(plans) > 1 else f"The candidate {one}."
