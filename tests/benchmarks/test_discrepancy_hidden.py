"""A small, fixed part of the benchmark: hidden effects are found by a process that sees a log only.

`slopewise bench discrepancy` runs all of it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.discovery import campaign, catalogue, charts, tables, tasks
from benchmarks.discovery.catalogue import Order
from benchmarks.discovery.kept import KeptSets
from benchmarks.discovery.model_tables import tables_of
from benchmarks.discovery.score import SetOutcome, score
from benchmarks.discovery.sealed import Inquiry, SealedLog

EASY = catalogue.SetConditions(
    designs=("mixed",), counts=(40,), noises=(0.01, 0.03), scatters=(0.005, 0.02)
)


@pytest.fixture(scope="module")
def inquiry() -> Iterator[Inquiry]:
    with Inquiry() as process:
        yield process


def asked(inquiry: Inquiry, kind: str, names: str, size: str, seed: int) -> SetOutcome:
    hidden = catalogue.make(Order(kind, tuple(names.split("+")) if names else (), size, seed), EASY)
    outcome = score(hidden, inquiry.ask(SealedLog(hidden.columns, tables_of(hidden.configured))))
    assert outcome.verdict != "fault", outcome.text
    return outcome


@pytest.mark.parametrize(
    ("names", "seed"),
    [
        ("brake_lag", 1),
        ("aerodynamic_drag", 2),
        ("cross_slope", 3),
        ("step_change", 4),
        ("surface_patch", 5),
        ("directional_surface", 6),
    ],
)
def test_a_large_effect_is_named_and_closes_the_gap(
    inquiry: Inquiry, names: str, seed: int
) -> None:
    outcome = asked(inquiry, "single", names, "large", seed)
    assert outcome.identifiable
    assert outcome.right, (outcome.verdict, outcome.named)
    assert outcome.axis_right, outcome.located
    closed = outcome.closing.share
    # The rim of a patch lies anywhere between the stops, and fresh ones fall there.
    least = 0.2 if names == "surface_patch" else 0.8
    assert closed is None or closed > least


def test_both_of_a_pair_are_named(inquiry: Inquiry) -> None:
    outcome = asked(inquiry, "pair", "brake_lag+cross_slope", "large", 11)
    assert outcome.right, (outcome.verdict, outcome.named)


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_nothing_is_missing_in_clean_logs(inquiry: Inquiry, seed: int) -> None:
    assert asked(inquiry, "clean", "", "", seed).verdict in ("none", "parameter_drift")


def test_other_coefficients_are_no_missing_effect(inquiry: Inquiry) -> None:
    outcome = asked(inquiry, "drift", "", "", 31)
    assert outcome.verdict == "parameter_drift"
    assert outcome.closing.share is not None
    assert outcome.closing.share > 0.9


@pytest.mark.parametrize(("name", "seed"), [("grab", 41), ("bump", 42)])
def test_what_has_no_name_gets_none(inquiry: Inquiry, name: str, seed: int) -> None:
    outcome = asked(inquiry, "off", name, "large", seed)
    # Unknown, or at least the axis that it follows.
    assert outcome.verdict not in ("missing_effect", "ambiguous"), outcome.named
    assert outcome.axis_right, outcome.located


@pytest.mark.parametrize("name", catalogue.ABSORBED)
def test_what_the_base_takes_up_gets_no_name(inquiry: Inquiry, name: str) -> None:
    assert asked(inquiry, "absorbed", name, "medium", 51).verdict != "missing_effect"


def test_the_process_holds_no_memory_and_no_folder_of_the_truth(inquiry: Inquiry) -> None:
    pool = inquiry._pool
    assert pool.submit(os.getppid).result() == os.getpid()
    assert pool.submit(os.listdir).result() == []
    # Neither what knows of effects to hide, nor any set that was made.
    modules = pool.submit(eval, "sorted(__import__('sys').modules)").result()
    for name in ("catalogue", "hidden", "campaign", "tasks", "score"):
        assert f"benchmarks.discovery.{name}" not in modules


def test_a_campaign_goes_on_where_it_was_and_adds_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = [Order("clean", (), "", 61), Order("single", ("brake_lag",), "large", 62)]
    todo = [tasks.SetTask(plant=order) for order in chosen]
    promised: list[str] = []
    kept = KeptSets(tmp_path, EASY)
    for task in todo:
        kept.put(tasks.do(task, EASY, promised.append))
    # A line that an interruption cut off is no outcome.
    with kept.file.open("ab") as file:
        file.write(kept.file.read_bytes()[:200])
    monkeypatch.setattr(campaign, "planned", lambda size: [*todo, tasks.SetTask(rivals=1)])
    steps: list[int] = []
    size = campaign.SetCounts(share=0.0, most=3, conditions=EASY, engine=0.0, cases=0, minutes=0.0)
    result = campaign.run(size, steps.append, tmp_path)
    assert sum(steps) == result["sets"] == len(todo)
    assert result["planned"] == 3
    assert [o["kind"] for o in result["outcomes"]] == ["clean", "single"]
    assert [s["digest"] for s in result["sealed"]] == promised
    assert json.loads(result["sealed"][1]["truths"])[0]["names"] == ["brake_lag"]
    assert KeptSets(tmp_path, catalogue.ALL).find() == {}
    assert json.loads(json.dumps(result, allow_nan=False))["by_effect"] == result["by_effect"]
    assert len(list(tables.tables(result))) >= 2
    assert len(charts.charts(result)) == 3
    assert {row["effect"]: row["sets"] for row in result["by_effect"]} == {"": 1, "brake_lag": 1}
