"""Campaigns: an interrupted run resumes, and results of other sources or conditions are ignored."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop import loop_campaign
from benchmarks.common.campaign import BenchmarkRequest, no_progress, run_numbered
from benchmarks.common.result_cache import PickleCache, digest_of_sources
from benchmarks.discrepancy import catalogue, discrepancy_campaign
from benchmarks.discrepancy.catalogue import SetConditions, SetSpec
from benchmarks.discrepancy.discrepancy_campaign import QUICK, SetCache, run_sets
from benchmarks.discrepancy.tasks import SetTask, run_task

EASY = SetConditions(designs=("mixed",), counts=(40,), noises=(0.01,), scatters=(0.005,))


class _Square:
    """Squares, each of which leaves a file; fails at one number."""

    def __init__(self, folder: Path, fails_at: int | None = None) -> None:
        folder.mkdir(exist_ok=True)
        self._folder, self._fails_at = folder, fails_at

    def __call__(self, number: int) -> int:
        if number == self._fails_at:
            raise RuntimeError("interrupted")
        (self._folder / f"{number}").touch()
        return number * number

    @property
    def finished(self) -> set[int]:
        return {int(file.name) for file in self._folder.iterdir()}


def test_interrupted_jobs_resume(tmp_path: Path) -> None:
    cache = PickleCache(tmp_path / "runs")
    first = _Square(tmp_path / "first", fails_at=5)
    with pytest.raises(RuntimeError, match="interrupted"):
        run_numbered(first, range(6), no_progress, "squares", cache)
    assert first.finished
    again = _Square(tmp_path / "second")
    results = run_numbered(again, range(6), no_progress, "squares", cache)
    assert results == [0, 1, 4, 9, 16, 25]
    assert again.finished == set(range(6)) - first.finished


def test_jobs_without_cache_run_again(tmp_path: Path) -> None:
    work = _Square(tmp_path / "jobs")
    assert run_numbered(work, [3, 1], no_progress, "squares", None) == [9, 1]
    assert work.finished == {1, 3}


def test_cache_ignores_other_origins_and_partial_files(tmp_path: Path) -> None:
    caches = [loop_campaign.drive_cache(tmp_path, "driving: a b", m) for m in ("one", "other")]
    caches[0].put(4, "result")
    assert caches[0].find(4) == "result"
    assert caches[1].find(4) is None
    (caches[0].folder / "7.123").write_bytes(b"half")
    assert caches[0].find(7) is None


def test_digest_follows_sources_and_origins() -> None:
    parts = ("benchmarks/obstacles", "models/laws")
    digest = digest_of_sources(parts, ())
    assert digest != digest_of_sources(parts, ("cases.py",))
    assert digest != digest_of_sources(parts, (), "origin")
    assert digest != digest_of_sources(parts[:1], ())


def test_sets_resume_commit_to_their_truth_and_add_up(tmp_path: Path) -> None:
    specs = [SetSpec("clean", (), "", 61), SetSpec("single", ("brake_lag",), "large", 62)]
    todo = [SetTask(plant=spec) for spec in specs]
    announced: list[str] = []
    cache = SetCache(tmp_path, EASY)
    for task in todo:
        cache.put(run_task(task, EASY, announced.append))
    # An interruption truncates the last line.
    with cache.outcomes.file.open("ab") as file:
        file.write(cache.outcomes.file.read_bytes()[:200])
    steps: list[int] = []

    def progress(_title: str, total: int) -> Callable[[int], Any]:
        assert total == 3
        return steps.append

    size = replace(QUICK, conditions=EASY, minutes=0.0)
    result = run_sets([*todo, SetTask(ambiguous=1)], size, progress, tmp_path)
    assert sum(steps) == result["sets"] == len(todo)
    assert result["planned"] == 3
    assert [o["kind"] for o in result["outcomes"]] == ["clean", "single"]
    assert [s["digest"] for s in result["sealed"]] == announced
    assert json.loads(result["sealed"][1]["truths"])[0]["names"] == ["brake_lag"]
    assert SetCache(tmp_path, catalogue.ALL).find() == {}
    assert json.loads(json.dumps(result, allow_nan=False))["by_effect"] == result["by_effect"]
    assert {row["effect"]: row["sets"] for row in result["by_effect"]} == {"": 1, "brake_lag": 1}
    assert result["peer"][0]["gls_scan"]["hits"] == 1
    console = Console(record=True, width=150)
    discrepancy_campaign.show(result, console)
    text = console.export_text()
    assert "right name first" in text
    assert "GLS scan" in text


@pytest.mark.nightly
def test_every_world_is_investigated(tmp_path: Path) -> None:
    size = replace(QUICK, share=0.0, engine=0.01, cases=1, multibody=0.01, max_sets=4)
    todo = discrepancy_campaign.planned(size)
    result = run_sets(todo, size, no_progress, tmp_path)
    assert result["sets"] == 4
    again = run_sets(todo, replace(size, minutes=0.0), no_progress, tmp_path)
    assert again == result


@pytest.mark.nightly
def test_quick_closed_loop_is_safe_and_resumes(tmp_path: Path) -> None:
    request = BenchmarkRequest(quick=True, out=tmp_path)
    first = loop_campaign.run(request, no_progress)
    reached = {row["what"]: row["reached"] for row in first["targets"]}
    assert reached["collisions"] == reached["stops past the clear distance"] == 0
    assert reached["mean speed, share of perfect knowledge"] > 0.75
    again = loop_campaign.run(request, no_progress)
    assert again["policies"] == first["policies"]
    assert again["seconds"] < 0.2 * first["seconds"]
