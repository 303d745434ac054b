from __future__ import annotations

import pytest

from slopewise.services.fleet.fleet_summary import (
    FleetSummary,
    format_effects,
    sort_by_prediction_error,
    summarise_fleet,
)
from slopewise.services.fleet.vehicle_finding import DONE, REFUSED, Row, row_without_finding


def row(vehicle: str, verdict: str, *effects: Row, before: float = 0.1) -> Row:
    base = row_without_finding(vehicle, "", DONE, "")
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
    row_without_finding("e", "", REFUSED, "too few stops"),
]


def summary_of(rows: list[Row]) -> FleetSummary:
    return summarise_fleet(rows, 0.02, resumed=0, unexpected=0, seconds=0.0)


def test_named_and_ambiguous_effects_are_counted_separately() -> None:
    summary = summary_of(ROWS)
    assert (summary.examined, summary.failed) == (4, {"e": "too few stops"})
    assert summary.verdicts == {"missing_effect": 2, "ambiguous": 1, "none": 1}
    assert summary.expected_false == pytest.approx(0.08)
    first, second = summary.effects
    assert (first.name, first.vehicles, first.ambiguous_in) == ("brake_lag", ("a", "c"), ("d",))
    assert first.confidence == pytest.approx((0.6, 0.75, 0.9))
    assert first.expected_true == pytest.approx(1.5)
    tau = first.parameters["tau"]  # where it is named
    assert (tau.unit, tau.minimum, tau.maximum) == ("s", 0.1, 0.2)
    assert tau.median == pytest.approx(0.15)
    assert (second.name, second.vehicles, second.ambiguous_in) == ("brake_fade", (), ("d",))
    assert second.confidence is None


def test_texts_of_effects_and_rows() -> None:
    first, second = summary_of(ROWS).effects
    numbers = "tau = 0.15 (0.1 … 0.2) s"
    assert first.cells(4) == ("2 of 4", "60% … 90%", "1.5", "1", numbers)
    assert second.cells(4) == ("", "", "", "1", "")
    assert [r["vehicle"] for r in sort_by_prediction_error(ROWS)] == ["c", "d", "a", "b"]
    assert format_effects(ROWS[3]) == "brake_lag 50% or brake_fade"
    confident = row("f", "missing_effect", lag(0.9999, 0.2))
    assert format_effects(confident) == "brake_lag more than 99%"


def test_only_some_failed_vehicles_are_listed() -> None:
    rows = [row_without_finding(f"r{i}", "", REFUSED, "no") for i in range(5)]
    summary = summary_of(rows)
    assert "no" in summary.list_failed(5)[4]
    lines = summary.list_failed(3)
    assert len(lines) == 4
    assert lines[3].startswith("2 more")
