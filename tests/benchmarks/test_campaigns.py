"""Campaigns: an interrupted run resumes, and results of other sources or conditions are ignored."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.__main__ import main
from benchmarks.common.campaign import (
    BenchmarkRequest,
    ResultCache,
    digest_of_sources,
    no_progress,
    run_jobs,
)
from benchmarks.discrepancy import naming_benchmark
from benchmarks.discrepancy.naming_benchmark import Request, run_logs


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


@pytest.mark.nightly  # by day jobs resume above, and test_missing_effects.py judges findings
def test_logs_resume_and_add_up(tmp_path: Path) -> None:
    todo = [Request("plant", "single", "brake_lag", 62), Request("plant", "clean", "", 61)]
    request = BenchmarkRequest(out=tmp_path)
    result = run_logs(todo, request, no_progress)
    steps: list[int] = []
    # In no time nothing more is run.
    later = BenchmarkRequest(out=tmp_path, minutes=0.0)
    more = [*todo, Request("engine", "clean", "", 1)]
    again = run_logs(more, later, lambda _title, _total: steps.append)
    assert again == result | {"planned": 3}
    assert sum(steps) == again["logs"] == 2
    rows = {row["kind"]: row for row in result["rows"]}
    assert (rows["single"]["right"], rows["clean"]["right"]) == (1, 1)
    assert json.loads(json.dumps(result, allow_nan=False))["stated"] == result["stated"]
    console = Console(record=True, width=150)
    naming_benchmark.show(result, console)
    assert "gap on stops held out" in console.export_text()


def test_every_first_part_of_the_logs_is_a_fair_share() -> None:
    every = naming_benchmark.requests("plant") + naming_benchmark.requests("rocking")
    order = naming_benchmark.spread(every)
    assert sorted(map(repr, order)) == sorted(map(repr, every))
    assert len({job.seed for job in every}) == len(every)
    for world in ("plant", "rocking"):
        assert sum(j.world == world and j.kind == "clean" for j in every) == 75
    for end in (30, 100, 200):
        for kind in ("clean", "single"):
            expected = end / len(every) * sum(job.kind == kind for job in every)
            assert sum(job.kind == kind for job in order[:end]) == pytest.approx(expected, abs=5.0)


def test_a_run_says_at_once_how_much_it_is_and_where_it_cannot_write(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    module = SimpleNamespace(
        run=lambda _, progress: [progress("drives", 7)(1), capsys.readouterr().err][1:],
        show=lambda result, console: console.print(result),
    )
    monkeypatch.setattr("benchmarks.__main__.benchmark", lambda _: module)
    main(["cycle", "--json", str(tmp_path / "figures.json")])
    assert json.loads((tmp_path / "figures.json").read_text()) == ["drives: 7 steps …\n"]
    with pytest.raises(SystemExit, match="2"):
        main(["cycle", "--json", str(tmp_path / "none" / "figures.json")])
    assert "--json: expected a file in a writable folder" in capsys.readouterr().err
