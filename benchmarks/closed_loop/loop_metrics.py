"""Figures of a campaign's drives: safety, speed, and predicted stopping distances; with tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .quad import LIMITS
from .records import DrivenScene

Result = dict[str, Any]

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


def summary(drives: list[DrivenScene], perfect: list[DrivenScene]) -> Result:
    """Figures of one policy.

    Args:
        drives: drives of the policy.
        perfect: drives with perfect knowledge, on the same scenes in the same order.
    """
    stops = [stop for drive in drives for stop in drive.stops]
    forced = [stop for stop in stops if stop.forced]
    excess = np.array([s.predicted - s.actual for s in stops])
    light = np.array([drive.min_load_shares.min() < LIMITS.min_load for drive in drives])
    unavoidable = np.array([drive.min_load_shares.min() < LIMITS.min_load for drive in perfect])
    distance = sum(drive.distance for drive in drives)
    grades = [np.rad2deg(np.abs(drive.history[:, 5]).max()) for drive in drives]
    return {
        "drives": len(drives),
        "finished": sum(drive.finished for drive in drives),
        "distance": distance,
        "forced_stops": len(forced),
        "own_stops": len(stops) - len(forced),
        "collisions": sum(drive.collisions for drive in drives),
        "past_clear": sum(drive.past_clear for drive in drives),
        "farthest_past": max(drive.farthest for drive in drives),
        "load_violations": int(light.sum()),
        "load_violations_avoidable": int((light & ~unavoidable).sum()),
        "least_load": float(min(drive.min_load_shares.min() for drive in drives)),
        "least_wheel_load": float(min(drive.min_wheel_load for drive in drives)),
        "mean_speed": distance / sum(drive.moving_time for drive in drives),
        "track_error": float(np.quantile([drive.track_error for drive in drives], 0.95)),
        "steepest_deg": float(max(grades)),
        "covered": float(np.mean(excess >= 0.0)),
        "short": int(np.sum(excess < 0.0)),
        "worst_excess": float(excess.min()),
        "mean_excess": float(np.mean(excess)),
    }


def targets(results: dict[str, Result], policy: str, perfect: str) -> list[Result]:
    """Targets of a policy with the values that it reached."""
    r = results[policy]
    speed_share = r["mean_speed"] / results[perfect]["mean_speed"]
    rows: list[tuple[str, str, float, float]] = [
        ("drives", ">=", 300, r["drives"]),
        ("forced stops", ">=", 1000, r["forced_stops"]),
        ("collisions", "<=", 0, r["collisions"]),
        ("stops past the clear distance", "<=", 0, r["past_clear"]),
        (
            "load violations that perfect knowledge avoids",
            "<=",
            0,
            r["load_violations_avoidable"],
        ),
        ("mean speed, share of perfect knowledge", ">=", 0.85, speed_share),
        ("stops not longer than predicted, share", ">=", 0.999, r["covered"]),
        ("mean excess of the prediction [m]", "<=", 0.25, r["mean_excess"]),
    ]
    return [
        {
            "what": what,
            "relation": relation,
            "wanted": target,
            "reached": float(reached),
            "passed": bool(reached >= target if relation == ">=" else reached <= target),
        }
        for what, relation, target, reached in rows
    ]


def show(result: Result, console: Console) -> None:
    """Print the table of all policies, then the targets."""
    by_policy = Table(title=f"closed loop: {result['ground']}")
    by_policy.add_column("policy")
    for title, _, _ in COLUMNS:
        by_policy.add_column(title, justify="right")
    for name, row in result["policies"].items():
        by_policy.add_row(name, *(form.format(row[key]) for _, key, form in COLUMNS))
    console.print(by_policy)
    reached = Table(title="targets and values reached")
    for title in ("what", "target", "reached", ""):
        reached.add_column(title, justify="left" if title == "what" else "right")
    for row in result["targets"]:
        sign = {">=": "≥", "<=": "≤"}[row["relation"]]
        mark = "yes" if row["passed"] else "[red]no[/]"
        figures = (f"{sign} {row['wanted']:g}", f"{row['reached']:.4g}")
        reached.add_row(escape(row["what"]), *figures, mark)
    console.print(reached)
