"""What `slopewise check` shows: a table of plans and of what was found, or JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from slopewise.services.check.check_report import CheckReport, Violation
from slopewise.services.check.tolerances import TOLERANCES
from slopewise.services.cli.commands.check import CheckResult
from slopewise.services.report.plan_labels import plural


def as_json(result: CheckResult) -> dict[str, Any]:
    """For machines: every violation, a summary of each plan, and what was allowed."""
    return {
        "model": result.model,
        "valid": result.valid,
        "seconds": result.seconds,
        "notes": list(result.notes),
        "violations": [_plain(violation) for violation in result.violations],
        "plans": [
            {
                "candidate": report.candidate,
                "status": report.status,
                "valid": report.valid,
                "stations": len(report.station),
                "stops": report.stops,
                "kinds": _count(report),
                "notes": list(report.notes),
            }
            for report in result.reports
        ],
        "tolerances": {
            kind: {"value": t.value, "unit": t.unit, "meaning": t.meaning, "why": t.rationale}
            for kind, t in TOLERANCES.items()
        },
    }


def _plain(violation: Violation) -> dict[str, Any]:
    values = asdict(violation)
    return values | {"size": violation.size if np.isfinite(violation.size) else None}


def _count(report: CheckReport) -> dict[str, int]:
    kinds: dict[str, int] = {}
    for violation in report.violations:
        kinds[violation.kind] = kinds.get(violation.kind, 0) + 1
    return kinds


def show(result: CheckResult, console: Console, most: int = 30) -> None:
    """Plans with something wrong first, then the worst of each kind in them."""
    bad = [report for report in result.reports if not report.valid]
    stops = sum(report.stops for report in result.reports)
    console.print(
        f"{plural(len(result.reports), 'plan')} with model {result.model}, "
        f"{plural(stops, 'emergency stop')}: "
        + (f"[red]{len(bad)} with violations[/]" if bad else "[green]no violation[/]")
    )
    if bad:
        console.print(_table(bad[:most]))
    if len(bad) > most:
        console.print(f"… and {len(bad) - most} more plans; --json gives all")
    of_plans = [note for report in result.reports for note in report.notes]
    for note in dict.fromkeys([*result.notes, *of_plans]):
        console.print(Text(f"note: {note}"), style="dim")


def _table(reports: list[CheckReport]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("candidate", no_wrap=True, max_width=18)
    table.add_column("kind", no_wrap=True)
    table.add_column("rows", justify="right", no_wrap=True)
    table.add_column("worst at\nm", justify="right", no_wrap=True)
    table.add_column("by", justify="right", no_wrap=True)
    table.add_column("what", overflow="fold")
    for report in reports:
        counts = _count(report)
        for kind, violation in sorted(report.worst().items(), key=lambda item: item[1].row):
            table.add_row(
                Text(report.candidate),
                kind,
                str(counts[kind]),
                f"{violation.station:.2f}",
                f"{violation.size:.3g} {violation.unit}",
                Text(violation.sentence),
            )
    return table
