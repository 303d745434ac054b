"""Campaigns: an interrupted run resumes, and results of other sources or conditions are ignored."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop import loop_campaign
from benchmarks.common.campaign import (
    BenchmarkRequest,
    ResultCache,
    digest_of_sources,
    no_progress,
    run_jobs,
)
from benchmarks.discrepancy import discrepancy_campaign
from benchmarks.discrepancy.car_outcomes import CarSpec
from benchmarks.discrepancy.catalogue import ALL, SetConditions, SetSpec
from benchmarks.discrepancy.discrepancy_campaign import QUICK, run_sets

EASY = SetConditions(designs=("mixed",), counts=(40,), noises=(0.01,), scatters=(0.005,))


def square(folder: Path, fails_at: int, number: int) -> int:
    """Square of a number, which leaves a file."""
    if number == fails_at:
        raise RuntimeError("interrupted")
    (folder / f"{number}").touch()
    return number * number


def test_interrupted_jobs_resume(tmp_path: Path) -> None:
    first, again = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    again.mkdir()
    stored = ResultCache(tmp_path / "runs")
    with pytest.raises(RuntimeError, match="interrupted"):
        run_jobs(partial(square, first, 5), range(6), no_progress, "squares", stored)
    before = {n for n in range(6) if stored.find(n) is not None}
    assert before <= {int(file.name) for file in first.iterdir()}
    results = run_jobs(partial(square, again, -1), range(6), no_progress, "squares", stored)
    assert results == [0, 1, 4, 9, 16, 25]
    assert {int(file.name) for file in again.iterdir()} == set(range(6)) - before
    (stored.folder / "7.123").write_bytes(b"half")
    assert stored.find(7) is None
    assert run_jobs(partial(square, again, -1), [3, 1], no_progress, "squares") == [9, 1]


def test_digest_follows_sources_and_origins() -> None:
    parts = ("benchmarks/obstacles", "models/laws")
    digest = digest_of_sources(parts, ())
    assert digest != digest_of_sources(parts, ("cases.py",))
    assert digest != digest_of_sources(parts, (), "origin")
    assert digest != digest_of_sources(parts[:1], ())


def test_sets_resume_and_add_up(tmp_path: Path) -> None:
    todo = [SetSpec("clean", (), "", 61), SetSpec("single", ("brake_lag",), "large", 62)]
    size = replace(QUICK, conditions=EASY)
    result = run_sets(todo, size, no_progress, tmp_path)
    steps: list[int] = []

    def progress(_title: str, total: int) -> Callable[[int], Any]:
        assert total == 3
        return steps.append

    # In no time nothing more is run.
    again = run_sets([*todo, CarSpec("", 1)], replace(size, minutes=0.0), progress, tmp_path)
    assert again == result | {"planned": 3}
    assert sum(steps) == again["sets"] == 2
    empty = run_sets(todo, replace(size, minutes=0.0, conditions=ALL), no_progress, tmp_path)
    assert empty["sets"] == 0
    assert [o["kind"] for o in result["outcomes"]] == ["clean", "single"]
    assert json.loads(json.dumps(result, allow_nan=False))["by_effect"] == result["by_effect"]
    assert {row["effect"]: row["sets"] for row in result["by_effect"]} == {"": 1, "brake_lag": 1}
    assert result["peer"][0]["gls_scan"]["hits"] == 1
    console = Console(record=True, width=150)
    discrepancy_campaign.show(result, console)
    text = console.export_text()
    assert "right name first" in text
    assert "GLS scan" in text


@pytest.mark.nightly
def test_quick_campaigns_run_every_world_safely(tmp_path: Path) -> None:
    todo = discrepancy_campaign.planned(replace(QUICK, share=0.0, multibody=0.01, max_sets=4))
    assert run_sets(todo, QUICK, no_progress, tmp_path)["sets"] == 4
    request = BenchmarkRequest(quick=True, out=tmp_path)
    first = loop_campaign.run(request, no_progress)
    reached = {row["what"]: row["reached"] for row in first["targets"]}
    assert reached["collisions"] == reached["stops past the clear distance"] == 0
    assert reached["mean speed, share of perfect knowledge"] > 0.75
    again = loop_campaign.run(request, no_progress)
    assert again["policies"] == first["policies"]
    assert again["seconds"] < 0.2 * first["seconds"]
