"""Texts of a fleet summary, on the screen and on the page."""

from __future__ import annotations

from collections.abc import Sequence

from slopewise.models.discrepancy.report.words import sure_words
from slopewise.services.fleet.finding_row import DONE, Row
from slopewise.services.fleet.fleet_summary import EffectPrevalence, FleetSummary


def format_false_alarms(summary: FleetSummary) -> str:
    """Expected number of names that are chance."""
    return (
        f"Expected false alarms: {summary.expected_false:.2g} of {summary.examined} vehicles if "
        "none lacked an effect."
    )


def list_failed(summary: FleetSummary, max_count: int) -> list[str]:
    """Vehicles without a finding, with the reason; beyond max_count only their number."""
    lines = [f"{name} is excluded: {reason}" for name, reason in summary.failed.items()]
    more = len(lines) - max_count
    if more <= 0:
        return lines
    return [*lines[:max_count], f"{more} more are excluded; findings.jsonl has the reasons"]


def prevalence_cells(effect: EffectPrevalence, examined: int) -> tuple[str, str, str, str]:
    """Vehicles, range of confidence, expected number of correct names, ambiguous vehicles."""
    ambiguous = str(len(effect.ambiguous_in)) if effect.ambiguous_in else ""
    if effect.confidence is None:
        return "", "", "", ambiguous
    low, _, high = map(sure_words, effect.confidence)
    confidence = low if low == high else f"{low} … {high}"
    vehicles = f"{len(effect.vehicles)} of {examined}"
    return vehicles, confidence, f"{effect.expected_true:.1f}", ambiguous


def format_parameters(effect: EffectPrevalence) -> str:
    """Each parameter: its median over the vehicles, and its range."""
    parts = []
    for name, (unit, low, middle, high) in effect.parameters.items():
        spread = "" if low == high else f" ({low:.3g} … {high:.3g})"
        parts.append(f"{name} = {middle:.3g}{spread} {unit if unit != '1' else ''}".rstrip())
    return ", ".join(parts)


def sort_by_prediction_error(rows: Sequence[Row]) -> list[Row]:
    """Rows with a finding, largest error of the stopping distance first."""
    done = [row for row in rows if row["status"] == DONE]
    return sorted(done, key=lambda row: (-(row["stop_distance_before"] or 0.0), row["vehicle"]))


def format_effects(row: Row) -> str:
    """Effects of a vehicle with their confidence and alternatives."""
    parts = []
    for effect in row["effects"]:
        alternatives = "".join(f" or {name}" for name in effect["alternatives"])
        parts.append(f"{effect['name']} {sure_words(effect['confidence'])}{alternatives}")
    return ", ".join(parts)
