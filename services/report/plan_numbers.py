"""Numbers of each plan, and one sentence on all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.io.units import finite

_OUTCOMES = (
    (Status.OK, "reaches the end of its path", "reach the end of their paths"),
    (Status.BLOCKED, "stops short of the end of its path", "stop short of the end of their paths"),
    (Status.DEGRADED, "needs a fallback", "need a fallback"),
    (Status.INFEASIBLE, "is infeasible", "are infeasible"),
)
"""Status, and the predicate of one candidate and of several."""


def numbers_of(plan: SpeedPlan, rank: int) -> dict[str, Any]:
    """One plan in numbers, of which 1 is the best rank; None where a number does not exist."""
    moving = plan.speed > 0.0
    last = min(int(np.flatnonzero(moving)[-1]) + 1, len(moving) - 1) if moving.any() else 0
    driven = slice(0, last + 1)
    longest_limit, limits_share = _find_longest_limit(plan, last)
    time = finite(plan.travel_time)
    with np.errstate(invalid="ignore"):  # inf - inf, where nothing limits
        margin = finite(plan.least_margin)
    return {
        "plan": plan,
        "rank": rank,
        "travel_time": time,  # until the last movement ends [s]
        "progress": plan.progress,  # station where it comes to rest [m]
        "length": float(plan.station[-1]),  # station where the path ends [m]
        "mean_speed": plan.progress / time if time else None,
        "max_speed": finite(np.max(plan.speed)),
        "margin": margin,  # smallest of an emergency stop to the clear distance [m]
        "rear_load": _smallest(plan.rear_load[driven]),  # share of the level static load [1]
        "side_load": _smallest(plan.side_load[driven]),
        "longest_limit": longest_limit,  # bound along most of the driven distance
        "limits_share": limits_share,  # share of that distance along which it holds [1]
        "path_deviation": None if plan.path_deviation is None else plan.path_deviation.largest,
    }


def _smallest(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else None


def _find_longest_limit(plan: SpeedPlan, last: int) -> tuple[Limiting | None, float]:
    """Bound along most of the driven distance; it holds from its station to the next."""
    if last == 0:
        return None, 0.0
    lengths = np.bincount(
        plan.limiting[:last], weights=np.diff(plan.station[: last + 1]), minlength=len(Limiting)
    )
    longest = int(lengths.argmax())
    return Limiting(longest), float(lengths[longest] / lengths.sum())


def best_plan(plans: Sequence[SpeedPlan]) -> int | None:
    """Index of the best ranked plan that may be driven; None if no plan may be driven."""
    return next((i for i, plan in enumerate(plans) if plan.admissible), None)


def verdict(plans: Sequence[SpeedPlan]) -> str:
    """Sentence on the outcome of the planning."""
    if not plans:
        return "There was no candidate to plan."
    count = Counter(plan.status for plan in plans)
    parts = [
        f"{count[status]} {singular if count[status] == 1 else several}"
        for status, singular, several in _OUTCOMES
        if count[status]
    ]
    if len(parts) > 1:
        if count[Status.OK] and count[Status.BLOCKED]:
            short = count[Status.BLOCKED]
            parts[1] = f"{short} {'stops' if short == 1 else 'stop'} short of it"
        return f"Of {len(plans)} candidates, {', '.join(parts[:-1])} and {parts[-1]}."
    _, singular, several = next(outcome for outcome in _OUTCOMES if count[outcome[0]])
    if len(plans) == 1:
        return f"The candidate {singular}."
    return f"All {len(plans)} candidates {several}."
