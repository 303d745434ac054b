from __future__ import annotations

import pytest

from slopewise.services.fleet.finding_row import DONE, REFUSED, Row, failed_finding
from slopewise.services.fleet.fleet_summary import summarise_fleet
from slopewise.services.fleet.fleet_text import (
    format_effects,
    format_parameters,
    list_failed,
    prevalence_cells,
    sort_by_prediction_error,
)


def row(vehicle: str, verdict: str, *effects: Row, before: float = 0.1) -> Row:
    base = failed_finding(vehicle, "", DONE, "")
    return base | {"verdict": verdict, "effects": list(effects), "stop_distance_before": before}


def lag(confidence: float, tau: float, *alternatives: str) -> Row:
    parameter = {"name": "tau", "value": tau, "std": 0.01, "unit": "s"}
    return {
        "name": "brake_lag",
        "confidence": confidence,
        "alternatives": list(alternatives),
        "parameters": [parameter],
    }


ROWS = [
    row("a", "missing_effect", lag(0.9, 0.2), before=0.2),
    row("b", "none"),
    row("c", "missing_effect", lag(0.6, 0.1), before=0.5),
    row("d", "ambiguous", lag(0.5, 0.4, "brake_fade"), before=0.3),
    failed_finding("e", "", REFUSED, "too few stops"),
]


def test_named_and_ambiguous_effects_are_counted_separately() -> None:
    summary = summarise_fleet(ROWS, 0.02)
    assert (summary.examined, summary.failed) == (4, {"e": "too few stops"})
    assert summary.verdicts == {"missing_effect": 2, "ambiguous": 1, "none": 1}
    assert summary.expected_false == pytest.approx(0.08)
    first, second = summary.effects
    assert (first.name, first.vehicles, first.ambiguous_in) == ("brake_lag", ("a", "c"), ("d",))
    assert first.confidence == pytest.approx((0.6, 0.75, 0.9))
    assert first.expected_true == pytest.approx(1.5)
    assert first.parameters["tau"] == ("s", 0.1, pytest.approx(0.15), 0.2)  # where it is named
    assert (second.name, second.vehicles, second.ambiguous_in) == ("brake_fade", (), ("d",))
    assert second.confidence is None


def test_texts_of_effects_and_rows() -> None:
    first, second = summarise_fleet(ROWS, 0.02).effects
    assert prevalence_cells(first, 4) == ("2 of 4", "60% … 90%", "1.5", "1")
    assert format_parameters(first) == "tau = 0.15 (0.1 … 0.2) s"
    assert prevalence_cells(second, 4) == ("", "", "", "1")
    assert [r["vehicle"] for r in sort_by_prediction_error(ROWS)] == ["c", "d", "a", "b"]
    assert format_effects(ROWS[3]) == "brake_lag 50% or brake_fade"
    confident = row("f", "missing_effect", lag(0.9999, 0.2))
    assert format_effects(confident) == "brake_lag more than 99%"


def test_only_some_failed_vehicles_are_listed() -> None:
    rows = [failed_finding(f"r{i}", "", REFUSED, "no") for i in range(5)]
    summary = summarise_fleet(rows, 0.02)
    assert "no" in list_failed(summary, 5)[4]
    lines = list_failed(summary, 3)
    assert len(lines) == 4
    assert lines[3].startswith("2 more")
