"""The benchmark's figures as tables for people."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from .metrics import Result

COLUMNS = (
    ("drives", "drives", "{:.0f}"),
    ("finished", "finished", "{:.0f}"),
    ("forced", "forced_stops", "{:.0f}"),
    ("collisions", "collisions", "{:.0f}"),
    ("past clear", "past_clear", "{:.0f}"),
    ("light", "load_violations", "{:.0f}"),
    ("avoidable", "load_violations_avoidable", "{:.0f}"),
    ("m/s", "mean_speed", "{:.2f}"),
    ("covered", "covered", "{:.2%}"),
    ("excess m", "mean_excess", "{:+.2f}"),
    ("worst m", "worst_excess", "{:+.2f}"),
)
"""Title, key and form of the figures of a policy."""


def tables(result: Result) -> list[Table]:
    """Policies side by side, and what was wanted."""
    by_policy = Table(title=f"closed loop: {result['ground']}")
    by_policy.add_column("policy")
    for title, _, _ in COLUMNS:
        by_policy.add_column(title, justify="right")
    for name, row in result["policies"].items():
        by_policy.add_row(name, *(form.format(row[key]) for _, key, form in COLUMNS))
    wanted = Table(title="wanted and reached")
    for title in ("what", "wanted", "reached", ""):
        wanted.add_column(title, justify="left" if title == "what" else "right")
    for row in result["targets"]:
        sign = {">=": "≥", "<=": "≤"}[row["relation"]]
        mark = "yes" if row["passed"] else "[red]no[/]"
        wanted.add_row(
            escape(row["what"]), f"{sign} {row['wanted']:g}", f"{row['reached']:.4g}", mark
        )
    return [by_policy, wanted]
