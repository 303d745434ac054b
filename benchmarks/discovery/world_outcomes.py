"""What is wanted of a world in which effects come about by physics, and what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

CLEAN = "clean"


@dataclass(frozen=True, slots=True)
class WorldOrder:
    """One set that is wanted: what is hidden ("" for nothing), seed, strength where there are."""

    what: str
    seed: int
    strength: str = ""


@dataclass(frozen=True, slots=True)
class WorldOutcome:
    """What was said of one set. See :class:`benchmarks.discovery.score.SetOutcome`."""

    what: str
    seed: int
    noise: float
    scatter: float
    verdict: str
    named: tuple[str, ...]
    right: bool
    wrong: bool
    before: float
    after: float
    floor: float
    closed: float | None
    told: float | None
    seconds: float
    text: str
    strength: str = ""
    worse: float = 0.0


def by_what(kind: str, outcomes: Sequence[WorldOutcome]) -> list[dict[str, Any]]:
    """Effect by effect, in the form of :func:`benchmarks.discovery.campaign.by_effect`."""
    groups: dict[tuple[str, str], list[WorldOutcome]] = {}
    for o in sorted(outcomes, key=lambda o: (o.what, STRENGTHS.index(o.strength))):
        groups.setdefault((o.what, o.strength), []).append(o)
    rows = []
    for (what, strength), group in groups.items():
        closed = sorted(o.closed for o in group if o.closed is not None)
        verdicts: dict[str, int] = {}
        for o in group:
            verdicts[o.verdict] = verdicts.get(o.verdict, 0) + 1
        rows.append(
            {
                "kind": kind, "effect": ", ".join(filter(None, (what, strength))),
                "sets": len(group), "identifiable": len(group),
                "right": sum(o.right for o in group), "wrong": sum(o.wrong for o in group),
                "axis": None, "verdicts": verdicts,
                "closed": closed[len(closed) // 2] if closed else None,
            }
        )  # fmt: skip
    return rows


STRENGTHS = ("", "small", "medium", "large")
"""In their order; a world without strengths knows only the first."""
