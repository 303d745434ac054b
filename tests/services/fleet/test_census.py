from __future__ import annotations

import pytest

from slopewise.services.fleet.census import census
from slopewise.services.fleet.finding import DONE, REFUSED, Row, without_answer
from slopewise.services.fleet.words import by_surprise, counted, effect_words, left_out, numbers


def row(vehicle: str, verdict: str, *effects: Row, before: float = 0.1) -> Row:
    base = without_answer(vehicle, "", DONE, "")
    return base | {"verdict": verdict, "effects": list(effects), "stop_distance_before": before}


def lag(confidence: float, tau: float, *others: str) -> Row:
    parameter = {"name": "tau", "value": tau, "std": 0.01, "unit": "s"}
    return {
        "name": "brake_lag",
        "confidence": confidence,
        "alternatives": list(others),
        "parameters": [parameter],
    }


ROWS = [
    row("a", "missing_effect", lag(0.9, 0.2), before=0.2),
    row("b", "none"),
    row("c", "missing_effect", lag(0.6, 0.1), before=0.5),
    row("d", "ambiguous", lag(0.5, 0.4, "brake_fade"), before=0.3),
    without_answer("e", "", REFUSED, "too few stops"),
]


def test_named_effects_and_those_that_may_be_are_counted_apart() -> None:
    counts = census(ROWS, 0.02)
    assert (counts.looked_at, counts.without) == (4, {"e": "too few stops"})
    assert counts.verdicts == {"missing_effect": 2, "ambiguous": 1, "none": 1}
    assert counts.by_chance == pytest.approx(0.08)
    first, second = counts.lacked
    assert (first.name, first.vehicles, first.perhaps) == ("brake_lag", ("a", "c"), ("d",))
    assert first.confidence == pytest.approx((0.6, 0.75, 0.9))
    assert first.right == pytest.approx(1.5)
    unit, low, middle, high = first.parameters["tau"]  # of those that are named
    assert (unit, low, middle, high) == ("s", 0.1, pytest.approx(0.15), 0.2)
    assert (second.name, second.vehicles, second.perhaps) == ("brake_fade", (), ("d",))
    assert second.confidence is None


def test_words() -> None:
    first, second = census(ROWS, 0.02).lacked
    assert counted(first, 4) == ("2 of 4", "60% … 90%", "1.5", "1")
    assert numbers(first) == "tau = 0.15 (0.1 … 0.2) s"
    assert counted(second, 4) == ("", "", "", "1")
    assert [r["vehicle"] for r in by_surprise(ROWS)] == ["c", "d", "a", "b"]
    assert effect_words(ROWS[3]) == "brake_lag 50% or brake_fade"
    assert effect_words(row("f", "missing_effect", lag(0.9999, 0.2))) == "brake_lag more than 99%"


def test_of_many_without_an_answer_some_are_told() -> None:
    counts = census([without_answer(f"r{i}", "", REFUSED, "no") for i in range(5)], 0.02)
    assert left_out(counts, 5)[4] == "r4 is left out: no"
    told = left_out(counts, 3)
    assert len(told) == 4
    assert told[3].startswith("2 more")


def test_a_fleet_without_answers_has_no_effects() -> None:
    counts = census(ROWS[4:], 0.02)
    assert (counts.looked_at, counts.lacked, counts.verdicts) == (0, (), {})
