"""What statuses, bounds and numbers of things are called, and what they mean."""

from __future__ import annotations

from slopewise.planner.limiting import BOUNDS, Limiting
from slopewise.planner.plan import Status

STATUS_MEANING: dict[Status, str] = {
    Status.OK: "reaches the end of its path",
    Status.BLOCKED: "a valid plan that stops before some station",
    Status.DEGRADED: "safe, but a fallback was used",
    Status.INFEASIBLE: "even full braking from the start is not enough",
}

LIMITING_MEANING: dict[Limiting, str] = {code: bound.meaning for code, bound in BOUNDS.items()}


def plural(count: int, noun: str) -> str:
    """A number of things, e.g. "1 candidate", "3 candidates", "2 batches"."""
    ending = "" if count == 1 else "es" if noun.endswith(("s", "ch")) else "s"
    return f"{count} {noun}{ending}"


def word(limiting: Limiting) -> str:
    """The name of a bound for people, e.g. "stopping path"."""
    return limiting.label.replace("_", " ")
