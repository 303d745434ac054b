"""The command of the closed loop, in its quick size: minutes, so at night."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")


_SAFE = ("collisions", "stops past the clear distance")


@pytest.mark.nightly
def test_the_quick_campaign_is_safe_and_can_be_resumed(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    closed_loop(quick=True, json_file=figures, out=tmp_path / "out")
    first = json.loads(figures.read_text())
    reached = {row["what"]: row["reached"] for row in first["targets"]}
    assert all(reached[what] == 0 for what in _SAFE)
    assert reached["mean speed, share of perfect knowledge"] > 0.75
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000
    closed_loop(quick=True, json_file=figures, out=tmp_path / "out")
    again = json.loads(figures.read_text())
    assert again["policies"] == first["policies"]
    assert again["seconds"] < 0.2 * first["seconds"]
