"""The page of the closed loop: every figure on it, and a missed target said in the first line."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.tables import COLUMNS, tables
from slopewise.services.report.closed_loop_page import render_report, write_report

PICTURES = {name: b"\x89PNG" + name.encode() for name in ("stops", "policies", "drive")}


def made_up(reached: float) -> dict[str, Any]:
    row = {
        "drives": 3,
        "finished": 3,
        "distance": 135.0,
        "forced_stops": 11,
        "collisions": 0,
        "past_clear": 0,
        "load_violations": 0,
        "load_violations_avoidable": 0,
        "mean_speed": 2.125,
        "covered": 1.0,
        "mean_excess": 0.1875,
        "worst_excess": 0.0625,
    }
    surface = {"m_m": -0.03125, "b_m": 0.0, "m_b": 0.0, "b_b": 0.4375, "distance_offset": 0.09375}
    return {
        "ground": "hills & <dales>",
        "policies": {"slopewise": row, "fixed 2 m/s": {**row, "collisions": 7}},
        "learned": {"slopewise": {"dead_time": 0.16, "surfaces": {"firm": surface}}},
        "targets": [
            {
                "what": "mean speed",
                "relation": ">=",
                "wanted": 0.85,
                "reached": reached,
                "passed": reached >= 0.85,
            },
        ],
    }


def test_figures_are_on_the_page() -> None:
    text = render_report(made_up(0.9), COLUMNS, PICTURES)
    for shown in ("2.12", "+0.19", "+0.06", "-0.0312", "+0.4375", "fixed 2 m/s", "≥ 0.85", "0.9"):
        assert shown in text
    assert "All 1 targets were reached." in text
    assert text.count("data:image/png;base64,") == len(PICTURES)


def test_units_in_brackets_are_no_markup_on_a_screen() -> None:
    result = made_up(0.9)
    result["targets"][0]["what"] = "mean excess [m]"
    console = Console(width=140, record=True, file=io.StringIO())
    for table in tables(result):
        console.print(table)
    assert "mean excess [m]" in console.export_text()


def test_names_cannot_break_the_page() -> None:
    text = render_report(made_up(0.9), COLUMNS, PICTURES)
    assert "hills &amp; &lt;dales&gt;" in text
    assert "<dales>" not in text


def test_a_missed_target_is_said_first(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_report(page, made_up(0.5), COLUMNS, PICTURES)
    text = page.read_text(encoding="utf-8")
    assert "1 of 1 targets were missed: mean speed." in text
    assert text.index("missed") < text.index("data:image/png")


def test_a_figure_that_is_missing_is_not_left_blank() -> None:
    result = made_up(0.9)
    del result["policies"]["slopewise"]["mean_speed"]
    with pytest.raises(KeyError, match="mean_speed"):
        render_report(result, COLUMNS, PICTURES)
