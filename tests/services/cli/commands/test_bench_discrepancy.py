"""`slopewise bench discrepancy` from end to end, on a few sets of each world."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.discovery import campaign
from slopewise.services.cli.commands import bench


@pytest.mark.nightly
def test_both_worlds_are_asked_and_written_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = replace(campaign.QUICK, share=0.0, engine=0.0, cases=1, multibody=0.0)
    monkeypatch.setattr(campaign, "QUICK", few)
    figures, page = tmp_path / "figures.json", tmp_path / "page.html"
    out = tmp_path / "kept"
    bench.discrepancy(quick=True, json_file=figures, plot=page, out=out, sets=3)
    result = json.loads(figures.read_text())
    assert result["sets"] == result["planned"] == 3
    assert len(next(iter(out.glob("sets-*.jsonl"))).read_text().split()) == 3
    assert "right name first" in capsys.readouterr().out
    again = tmp_path / "again.json"
    bench.discrepancy(quick=True, json_file=again, plot=None, out=out, sets=3, minutes=0.0)
    assert json.loads(again.read_text()) == result
    assert page.stat().st_size > 10_000
