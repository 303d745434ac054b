"""An explanation of a plan as a table for a screen and as JSON."""

from __future__ import annotations

from typing import Any

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from slopewise.planner.explain.explain import Explanation
from slopewise.services.report.plan_labels import limiting_label


def as_json(found: Explanation) -> dict[str, Any]:
    """For machines: stretches, what each bound costs, what to measure."""
    return {
        "candidate": found.plan.candidate,
        "stretches": [
            {"from": s.begin, "to": s.end, "limiting": s.limiting.label, "seconds": s.seconds}
            for s in found.stretches
        ],
        "costs": [
            {"limiting": c.limiting.label, "seconds": c.seconds, "reach": c.reach}
            for c in found.costs
        ],
        "measurements": [
            {"name": m.name, "seconds": m.seconds, "reach": m.reach, "sentence": m.sentence}
            for m in found.measurements
        ],
    }


def show(found: Explanation, console: Console) -> None:
    """Bounds by what they cost, and what to measure next."""
    table = Table(
        title=f"Why {found.plan.candidate} is not faster",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column("bound", no_wrap=True)
    for title in ("limits\ns", "where\nm", "without it\ns", "farther\nm"):
        table.add_column(title, justify="right")
    for cost in found.costs:
        own = [s for s in found.stretches if s.limiting is cost.limiting]
        if not own and cost.seconds <= 0.0:
            continue
        where = "–" if not own else f"{own[0].begin:.1f} … {own[-1].end:.1f}"
        table.add_row(
            limiting_label(cost.limiting),
            f"{sum(s.seconds for s in own):.2f}",
            where if len(own) < 2 else f"{where} ({len(own)} times)",
            f"−{cost.seconds:.2f}" if cost.seconds > 0.0 else "–",
            f"{cost.reach:.1f}" if cost.reach > 0.0 else "–",
        )
    console.print(table)
    useful = [m for m in found.measurements if m.seconds > 0.0]
    console.print("What to measure, by what it would buy:" if useful else "No measurement helps.")
    for measurement in useful:
        console.print(Padding(measurement.sentence, (0, 0, 0, 2)))
