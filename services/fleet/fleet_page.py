"""The page of `slopewise fleet discrepancy`: missing effects, confidence, errors in metres.

It links to the pages of the vehicles.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.effects.registry import LAWS
from slopewise.services.fleet.fleet_summary import (
    AMBIGUOUS,
    NAMED,
    FleetSummary,
    format_effects,
    sort_by_prediction_error,
)
from slopewise.services.fleet.vehicle_finding import VEHICLES, Row
from slopewise.services.io.findings_file import PAGE
from slopewise.services.jobs.plural import plural
from slopewise.services.report.discrepancy_page import STYLES, VERDICT_LABELS
from slopewise.services.report.figures import FAINT, FIRST, INK, SECOND, draw_figures
from slopewise.services.report.page import write_page

_MAX_VEHICLES, _MAX_NOTICES, _MAX_NAMES = 500, 20, 40
"""Vehicles of the table, excluded vehicles with their reason, and names below the figure."""
_DOT_AREA, _MIN_ALPHA = 46.0, 0.25  # Area of an effect's dot [pt²], and its opacity at confidence 0


def write_fleet_page(path: Path, rows: Sequence[Row], summary: FleetSummary) -> None:
    """Write the page next to ``vehicles/``, all or nothing."""
    done = sort_by_prediction_error(rows)
    notices = summary.list_failed(_MAX_NOTICES)
    if len(done) > _MAX_VEHICLES:
        notices.append(f"{plural(len(done) - _MAX_VEHICLES, 'more vehicle')} in findings.jsonl")
    facts = {"vehicles": str(len(rows))}
    facts |= {VERDICT_LABELS[Verdict(name)][0]: str(n) for name, n in summary.verdicts.items()}
    names = [effect.name for effect in summary.effects]
    size = (11.0, 3.6 + 0.3 * max(len(names), 1))
    values = {
        "title": f"{plural(summary.examined, 'vehicle')} compared with their logs",
        "verdict": _verdict(summary),
        "facts": facts,
        "notices": notices,
        "effects": [
            (effect.name, LAWS[effect.name].missing, *effect.cells(summary.examined))
            for effect in summary.effects
        ],
        "rows": [_vehicle_cells(row) for row in done[:_MAX_VEHICLES]],
        **draw_figures(picture=(size, lambda figure: _draw(figure, done, names))),
    }
    write_page(path, "fleet.html", values, "fleet", STYLES)


def _verdict(summary: FleetSummary) -> str:
    named = [effect for effect in summary.effects if effect.vehicles]
    listed = ", ".join(f"{e.name.replace('_', ' ')} in {len(e.vehicles)}" for e in named)
    missing = f"Missing: {listed}." if named else "No effect is named."
    return f"{missing} {summary.false_alarms}"


def _vehicle_cells(row: Row) -> tuple[str, ...]:
    name = row["vehicle"]
    return (
        "/".join(quote(part) for part in (VEHICLES, name, PAGE)),
        name,
        VERDICT_LABELS[Verdict(row["verdict"])][0],
        format_effects(row).replace("_", " "),
        str(row["stops"]),
        *(f"{row[f'stop_distance_{when}']:.2f} m" for when in ("before", "after")),
    )


def _draw(figure: Any, rows: Sequence[Row], effects: Sequence[str]) -> None:
    """Errors in metres of each vehicle, and below them the effects that explain them."""
    lines = max(len(effects), 1)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 0.3 * lines + 0.2))
    _draw_errors(above, rows)
    _draw_effects(below, rows, effects)
    below.set_xlim(-0.6, max(len(rows) - 0.4, 0.6))
    if len(rows) <= _MAX_NAMES:
        below.set_xticks(range(len(rows)), [r["vehicle"] for r in rows], rotation=60, ha="right")
    else:
        from matplotlib.ticker import MaxNLocator

        below.xaxis.set_major_locator(MaxNLocator(integer=True))
        below.set_xlabel("vehicles, the largest error first")


def _draw_errors(axes: Any, rows: Sequence[Row]) -> None:
    x = range(len(rows))
    before = [row["stop_distance_before"] for row in rows]
    after = [row["stop_distance_after"] for row in rows]
    axes.vlines(x, before, after, color=FAINT, lw=1.0)
    axes.plot(x, before, "o", ms=4.6, color=SECOND, label="by the model so far")
    axes.plot(x, after, "o", ms=4.6, color=FIRST, label="with what was found")
    axes.set(ylabel="stops are off by [m]", ylim=(0.0, None))
    axes.legend(fontsize=8.5)


def _draw_effects(axes: Any, rows: Sequence[Row], effects: Sequence[str]) -> None:
    line = {name: i for i, name in enumerate(effects)}
    for x, row in enumerate(rows):
        for effect in row["effects"]:
            if row["verdict"] == NAMED:
                confidence = min(max(effect["confidence"], 0.0), 1.0)
                alpha = _MIN_ALPHA + (1.0 - _MIN_ALPHA) * confidence
                axes.scatter(x, line[effect["name"]], s=_DOT_AREA, color=INK, alpha=alpha, lw=0)
            elif row["verdict"] == AMBIGUOUS:
                for name in (effect["name"], *effect["alternatives"]):
                    ring = {"facecolors": "none", "edgecolors": INK, "lw": 1.1}
                    axes.scatter(x, line[name], s=_DOT_AREA, **ring)
    axes.set_yticks(range(len(effects)), [name.replace("_", " ") for name in effects])
    axes.set_ylim(max(len(effects), 1) - 0.5, -0.5)
