"""A replayed drive as `replay --plan --json` prints it."""

from __future__ import annotations

from collections import Counter

from slopewise.services.jobs.replay_plan import (
    ReplayCycle,
    ReplayResult,
    cause,
    slowed_stretches,
    spread,
)
from slopewise.services.jobs.summary import Summary


class CauseRow(Summary, frozen=True):
    """Cycles with one status and cause, numbers of the reason omitted; `example` has them."""

    status: str
    cause: str
    cycles: int
    first: float
    example: str


class SlowedRow(Summary, frozen=True):
    """A stretch in which the driver would have been slowed: times [s], place [m], speeds [m/s].

    `driven` and `limit` are where they differ most, with the reason there.
    """

    begin: float
    end: float
    x: float
    y: float
    driven: float
    limit: float
    status: str
    reason: str


class ReplaySummary(Summary, frozen=True):
    """Output of `replay --plan --json`: SI units.

    `late`: cycles that took longer than the period; `missing`: cycles without a map or path.
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


def summarise(result: ReplayResult) -> ReplaySummary:
    """Quantiles, causes, and where the driver would have been slowed."""
    cycles = result.cycles
    stretches = slowed_stretches(cycles)
    return ReplaySummary.of(
        result,
        model=result.model.name,
        cycles=len(cycles),
        latency=spread([c.plan_seconds for c in cycles]),
        guard_latency=spread([c.guard_seconds for c in cycles]),
        late=sum(c.plan_seconds > result.period for c in cycles),
        statuses=_causes([(c.status, c.reason, c.time) for c in cycles]),
        guard=_causes([(c.action, c.guard_reason, c.time) for c in cycles]),
        slowed=[_slowed(stretch) for stretch in stretches],
        slowed_seconds=result.period * sum(map(len, stretches)),
    )


def _causes(rows: list[tuple[str, str, float]]) -> list[CauseRow]:
    counts = Counter((status, cause(reason)) for status, reason, _ in rows)
    first: dict[tuple[str, str], tuple[float, str]] = {}
    for status, reason, at in rows:
        first.setdefault((status, cause(reason)), (at, reason))
    return [
        CauseRow(status, text, count, *first[status, text])
        for (status, text), count in counts.most_common()
    ]


def _slowed(stretch: list[ReplayCycle]) -> SlowedRow:
    worst = max(stretch, key=lambda c: c.later - c.limit)
    return SlowedRow(
        stretch[0].time,
        stretch[-1].time,
        worst.pose.x,
        worst.pose.y,
        worst.later,
        worst.limit,
        worst.status,
        worst.reason,
    )
