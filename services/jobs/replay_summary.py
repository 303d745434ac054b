"""A replayed drive as `replay --plan --json` prints it."""

from __future__ import annotations

import math
import re
from collections import Counter

import numpy as np

from slopewise.services.jobs.plural import plural
from slopewise.services.jobs.replay_plan import ReplayCycle, ReplayResult
from slopewise.services.jobs.summary import Summary

_MAX_GAP = 0.5  # time between two slow-downs up to which they are one [s]
_QUANTILES = {"median": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
"""Quantiles of latencies by name [1]."""


class CauseRow(Summary, frozen=True):
    """Cycles with one status and cause, numbers of the reason omitted; `example` has them."""

    status: str
    cause: str
    cycles: int
    first: float
    example: str


class SlowedRow(Summary, frozen=True):
    """A stretch in which the driver would have been slowed: times [s], place [m], speeds [m/s].

    `driven` and `limit` are where they differ most, with the reason there; no place where odometry
    gave none.
    """

    begin: float
    end: float
    x: float | None
    y: float | None
    driven: float
    limit: float
    status: str
    reason: str


class ReplaySummary(Summary, frozen=True):
    """Output of `replay --plan --json`: SI units.

    `late`: cycles that took longer than the period; `missing`: cycles without a map, a path or
    odometry.
    """

    model: str
    driven: float
    period: float
    cycles: int
    received: dict[str, int]
    missing: dict[str, int]
    latency: dict[str, float]
    guard_latency: dict[str, float]
    late: int
    statuses: list[CauseRow]
    guard: list[CauseRow]
    slowed: list[SlowedRow]
    slowed_seconds: float

    @property
    def notices(self) -> list[str]:
        """Cycles without a plan and messages that were rejected or corrected, by reason."""
        expected = {"maps", "paths", "commands", "odometry"}
        rejected = {kind: n for kind, n in self.received.items() if kind not in expected}
        return [f"{reason}: {plural(n, 'cycle')}" for reason, n in self.missing.items()] + [
            f"{kind}: {plural(n, 'message')}" for kind, n in rejected.items()
        ]


def summarise(result: ReplayResult) -> ReplaySummary:
    """Quantiles, causes, and where the driver would have been slowed."""
    cycles = result.cycles
    stretches = _slowed_stretches(cycles)
    return ReplaySummary.of(
        result,
        model=result.model.name,
        cycles=len(cycles),
        latency=_quantiles([c.plan_seconds for c in cycles]),
        guard_latency=_quantiles([c.guard_seconds for c in cycles]),
        late=sum(c.plan_seconds > result.period for c in cycles),
        statuses=_causes([(c.answer.status.value, c.answer.reason, c.time) for c in cycles]),
        guard=_causes([(c.decision.action, c.decision.reason, c.time) for c in cycles]),
        slowed=[_slowed(stretch) for stretch in stretches],
        slowed_seconds=result.period * sum(map(len, stretches)),
    )


def _causes(rows: list[tuple[str, str, float]]) -> list[CauseRow]:
    """Causes by status, most frequent first; rows are status, reason and time [s]."""
    counts = Counter[tuple[str, str]]()
    first: dict[tuple[str, str], tuple[float, str]] = {}
    for status, reason, at in rows:
        key = status, _without_numbers(reason)
        counts[key] += 1
        first.setdefault(key, (at, reason))
    return [CauseRow(*key, count, *first[key]) for key, count in counts.most_common()]


def _slowed(stretch: list[ReplayCycle]) -> SlowedRow:
    worst = max(stretch, key=lambda c: c.next_speed - c.limit)
    return SlowedRow(
        stretch[0].time,
        stretch[-1].time,
        worst.pose.x if math.isfinite(worst.pose.x) else None,
        worst.pose.y if math.isfinite(worst.pose.y) else None,
        worst.next_speed,
        worst.limit,
        worst.answer.status.value,
        worst.answer.reason,
    )


def _without_numbers(reason: str) -> str:
    """A reason with … for its numbers, so that equal causes are counted together."""
    return re.sub(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", "…", reason)


def _quantiles(seconds: list[float]) -> dict[str, float]:
    """Quantiles of durations: name -> value [s]."""
    return {name: float(np.quantile(seconds, share)) for name, share in _QUANTILES.items()}


def _slowed_stretches(cycles: list[ReplayCycle]) -> list[list[ReplayCycle]]:
    """Cycles in which the driver would have been slowed, by stretch."""
    stretches: list[list[ReplayCycle]] = []
    for cycle in cycles:
        if not cycle.slows:
            continue
        if not stretches or cycle.time - stretches[-1][-1].time > _MAX_GAP:
            stretches.append([])
        stretches[-1].append(cycle)
    return stretches
