"""What is wanted of a world in which effects come about by physics, and what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .metrics import Metric, effect_row, figure, share

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
    return [
        effect_row(
            kind,
            ", ".join(filter(None, (what, strength))),
            group,
            group,
            [o.closed for o in group],
            None,
        )
        for (what, strength), group in groups.items()
    ]


def common_metrics(outcomes: Sequence[WorldOutcome], closing: float) -> list[Metric]:
    """What every world of physics is asked, beside how many names are right.

    Args:
        outcomes: of its sets. closing: share of the closable gap that is wanted in the median.
    """
    closed = [o.closed for o in outcomes if o.what != CLEAN and o.closed is not None]
    return [
        figure("closable gap closed, fresh stops, median", ">=", closing, closed, unit="share"),
        figure("time per 100 stops, median", "<=", 5.0, [o.seconds for o in outcomes], unit="s"),
        share("stops held out made worse", "<=", 0.0, [o.worse > 1.0 for o in outcomes]),
        share("faults of the workflow", "<=", 0.0, [o.verdict == "fault" for o in outcomes]),
    ]


STRENGTHS = ("", "small", "medium", "large")
"""In their order; a world without strengths knows only the first."""
