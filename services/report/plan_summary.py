"""What a page says of each plan in a row of its table, and of all of them in a sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.limiting import Limiting
from planner.plan import SpeedPlan, Status
from services.report.words import counted


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


def summarise(plan: SpeedPlan, rank: int) -> PlanSummary:
    """Numbers of one plan."""
    moving = plan.speed > 0.0
    last = min(int(np.flatnonzero(moving)[-1]) + 1, len(moving) - 1) if moving.any() else 0
    driven = slice(0, last + 1)
    limits_most, limits_share = _limits_most(plan, last)
    time = _finite(plan.travel_time)
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
        margin=_finite(plan.least_margin),
        rear_load=_least(plan.rear_load[driven]),
        side_load=_least(plan.side_load[driven]),
        limits_most=limits_most,
        limits_share=limits_share,
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
    parts = [
        _part(count[Status.OK], "reaches the end of its path", "reach the end of their paths"),
        _part(count[Status.BLOCKED], "stops before it", "stop before it"),
        _part(count[Status.DEGRADED], "needs a fallback", "need a fallback"),
        _part(count[Status.INFEASIBLE], "cannot be made safe", "cannot be made safe"),
    ]
    said = [part for part in parts if part]
    listed = said[0] if len(said) == 1 else f"{', '.join(said[:-1])} and {said[-1]}"
    if count[Status.BLOCKED] and not count[Status.OK]:
        listed = listed.replace("before it", "before the end of the path")
    total = counted(len(plans), "candidate", "candidates")
    return f"Of {total}, {listed}."


def _part(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}" if count else ""
