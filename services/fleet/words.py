"""What the count of a fleet says in words, on the screen and on the page."""

from __future__ import annotations

from collections.abc import Sequence

from slopewise.models.discrepancy.report.words import sure_words
from slopewise.services.fleet.census import Census, Lacked
from slopewise.services.fleet.finding import DONE, Row


def chance_words(c: Census) -> str:
    """How many of the names may be chance."""
    return (
        f"Were nothing missing in any of {c.looked_at} vehicles, {c.by_chance:.2g} of them would "
        "still be said to lack something."
    )


def left_out(c: Census, most: int) -> list[str]:
    """Vehicles without an answer, and why; of more than so many only their number."""
    told = [f"{name} is left out: {why}" for name, why in c.without.items()]
    more = len(told) - most
    return (
        told if more <= 0 else [*told[:most], f"{more} more are left out; findings.jsonl says why"]
    )


def counted(one: Lacked, looked_at: int) -> tuple[str, str, str, str]:
    """Vehicles, confidence from the least sure to the surest, vehicles named rightly, perhaps."""
    perhaps = str(len(one.perhaps)) if one.perhaps else ""
    if one.confidence is None:
        return "", "", "", perhaps
    low, _, high = map(sure_words, one.confidence)
    sure = low if low == high else f"{low} … {high}"
    return f"{len(one.vehicles)} of {looked_at}", sure, f"{one.right:.1f}", perhaps


def numbers(one: Lacked) -> str:
    """Each parameter: its median over the vehicles, and its range."""
    parts = []
    for name, (unit, low, middle, high) in one.parameters.items():
        wide = "" if low == high else f" ({low:.3g} … {high:.3g})"
        parts.append(f"{name} = {middle:.3g}{wide} {unit if unit != '1' else ''}".rstrip())
    return ", ".join(parts)


def by_surprise(rows: Sequence[Row]) -> list[Row]:
    """Those with an answer, the one first whose stops are furthest from its model's."""
    done = [row for row in rows if row["status"] == DONE]
    return sorted(done, key=lambda row: (-(row["stop_distance_before"] or 0.0), row["vehicle"]))


def effect_words(row: Row) -> str:
    """Its effects with their confidence, and what else each may be."""
    parts = []
    for effect in row["effects"]:
        others = "".join(f" or {name}" for name in effect["alternatives"])
        parts.append(f"{effect['name']} {sure_words(effect['confidence'])}{others}")
    return ", ".join(parts)
