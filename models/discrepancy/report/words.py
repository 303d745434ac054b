"""Findings in words that screen, page and fleet share."""

from __future__ import annotations

import numpy as np

from slopewise.models.discrepancy.findings import Findings, Gap, StopCost, Verdict
from slopewise.models.discrepancy.thresholds import MOST_SURE
from slopewise.models.effects.registry import LAWS


def sure_words(confidence: float) -> str:
    """Nothing is quite certain."""
    return f"more than {MOST_SURE:.0%}" if confidence > MOST_SURE else f"{confidence:.0%}"


def closed_words(gap: Gap) -> str:
    """How much of a gap is closed; nothing is ever quite closed."""
    if gap.closed is None or gap.ci95 is None:
        return "too near the floor for a percentage"
    low, high = (f"{min(end, MOST_SURE):.0%}" for end in gap.ci95)
    return f"{sure_words(gap.closed)} closed ({low} … {high})"


def cost_words(cost: StopCost) -> str:
    """What it costs, in metres of one stop."""
    slope = f"{abs(np.rad2deg(cost.grade)):.0f}° {'down' if cost.grade < 0.0 else 'up'}"
    where = f"at {cost.speed:.1f} m/s on {slope}"
    off = cost.after - cost.before
    if abs(off) < 0.005:
        return f"nothing {where}: {cost.after:.2f} m from the command to rest, as the model says"
    way = "more" if off > 0.0 else "less"
    return (
        f"{abs(off):.2f} m {where}: {cost.after:.2f} m from the command to rest, "
        f"{way} than the {cost.before:.2f} m of the model"
    )


def answers(f: Findings) -> dict[str, str]:
    """What a test engineer asks first, and the answer to each."""
    missing = "; ".join(
        f"{e.name.replace('_', ' ')}, {LAWS[e.name].missing}, {e.where}" for e in f.effects
    )
    nothing = "nothing that this log could show"
    if f.verdict in (Verdict.UNKNOWN, Verdict.TOO_NOISY, Verdict.UNIDENTIFIABLE):
        nothing = "nothing that could be named"
    others = [name for e in f.effects for name in e.alternatives]
    sure = ", ".join(sure_words(e.confidence) for e in f.effects)
    if others:
        sure += f"; or it is {' or '.join(dict.fromkeys(others))}"
    found = {"what is missing": missing or nothing}
    if f.cost is not None and f.verdict not in (Verdict.UNKNOWN, Verdict.TOO_NOISY):
        found["what it costs"] = cost_words(f.cost)
    if sure:
        found["how sure"] = sure
    found["what to do next"] = f.next_experiment.text or "nothing: this log leaves no question"
    found["changed in the model file"] = "; ".join(f.changes) or "nothing"
    return found
