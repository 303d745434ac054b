"""`slopewise bench discrepancy` from end to end, on a few sets of each world."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.discrepancy import campaign
from services.commands import bench


@pytest.mark.nightly
def test_both_worlds_are_asked_and_written_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(campaign, "QUICK", replace(campaign.QUICK, most=2, cases=1))
    figures, page = tmp_path / "figures.json", tmp_path / "page.html"
    bench.discrepancy(quick=True, json_file=figures, plot=page)
    result = json.loads(figures.read_text())
    assert len(result["outcomes"]) == 2
    assert json.loads(result["sealed"]["truths"])[0]["kind"] == result["outcomes"][0]["kind"]
    assert "right name first" in capsys.readouterr().out
    assert page.stat().st_size > 10_000
