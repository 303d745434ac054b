"""Findings as text, for screen, page and fleet."""

from __future__ import annotations

import numpy as np

from slopewise.models.discrepancy.findings import (
    CERTAIN,
    Findings,
    Gap,
    LikelyExplanation,
    StopCost,
    Verdict,
)
from slopewise.models.effects.registry import LAWS

UNSEEN = 0.005  # change of a stop that two decimals do not show [m]


def confidence_text(confidence: float) -> str:
    """Nothing is quite certain."""
    more = "more than " if confidence > CERTAIN else ""
    return f"{more}{min(confidence, CERTAIN):.0%}"


def _weighed(explanation: LikelyExplanation) -> str:
    """Names or axes of an explanation, and its weight."""
    causes = [*explanation.names, *(f"an unknown along {axis}" for axis in explanation.axes)]
    return f"{' and '.join(causes) or 'none of them'} ({explanation.weight:.0%})"


def closed_text(gap: Gap) -> str:
    """How much of a gap is closed; nothing is ever quite closed."""
    if gap.closed is None or gap.ci95 is None:
        return "too near the floor for a percentage"
    low, high = (f"{min(end, CERTAIN):.0%}" for end in gap.ci95)
    return f"{confidence_text(gap.closed)} closed ({low} … {high})"


def cost_text(cost: StopCost) -> str:
    """Cost in metres of a stop."""
    slope = f"{abs(np.rad2deg(cost.grade)):.0f}° {'down' if cost.grade < 0.0 else 'up'}"
    where = f"at {cost.speed:.1f} m/s on {slope}"
    change = cost.after - cost.before
    if abs(change) < UNSEEN:
        return f"nothing {where}: {cost.after:.2f} m from the command to rest, as the model says"
    way = "more" if change > 0.0 else "less"
    return (
        f"{abs(change):.2f} m {where}: {cost.after:.2f} m from the command to rest, "
        f"{way} than the {cost.before:.2f} m of the model"
    )


def answers(f: Findings) -> dict[str, str]:
    """What a test engineer asks first, with answers."""
    missing = "; ".join(
        f"{e.name.replace('_', ' ')}, {LAWS[e.name].missing}, {e.where}" for e in f.effects
    )
    nothing = "nothing that this log could show"
    if f.verdict in (Verdict.UNKNOWN, Verdict.TOO_NOISY, Verdict.UNIDENTIFIABLE):
        nothing = "nothing that could be named"
    parts = [", ".join(confidence_text(e.confidence) for e in f.effects)] if f.effects else []
    named = {e.name for e in f.effects}
    alternatives = [e for e in f.explanations if e.axes or {*e.names} != named]
    if alternatives:
        begin = "or it is" if f.effects else "it is"
        parts.append(f"{begin} {', '.join(map(_weighed, alternatives))}")
    replies = {"what is missing": missing or nothing}
    if f.verdict not in (Verdict.UNKNOWN, Verdict.TOO_NOISY):
        replies["what it costs"] = cost_text(f.cost)
    if parts:
        replies["how sure"] = "; ".join(parts)
    replies["what to do next"] = f.next_experiment.text or "nothing: this log leaves no question"
    replies["changed in the model file"] = "; ".join(f.changes) or "nothing"
    return replies
