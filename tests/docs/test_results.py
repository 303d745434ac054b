"""Results of benchmarks and the page of unmodelled effects are those of their scripts."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from examples import not_modelled
from examples.neglected_effects import LOADS, METRES, Row, Stop
from examples.not_modelled import NAMES
from slopewise.services.io.model_file import find_model, read_model

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "site"))

import results  # noqa: E402

OPTIMALITY = {
    "solved_by_both": 7,
    "excess": {"least": 0.0, "median": 0.001, "p90": 0.002, "p99": 0.003, "most": 0.00412},
    "seconds": {"IPOPT": {"median": 0.002}},
    "ratio": {"median": 12.3, "least": 4.0, "share": 0.5},
    "above": [{"excess": 0.02, "name": "steep | icy"}],
    "unsolved": [],
}
PAGE = "before\n<!-- results: optimality -->\nby hand\n<!-- end of results -->\nafter\n"


def put(folder: Path, name: str, result: object) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(json.dumps(result))
    return folder / name


def test_what_was_written_by_hand_stays_until_there_is_a_result(tmp_path: Path) -> None:
    assert results.filled(PAGE, tmp_path) == PAGE
    put(tmp_path, "optimality.json", OPTIMALITY)
    page = results.filled(PAGE, tmp_path)
    assert "by hand" not in page
    assert page.startswith("before\n<!-- results: optimality -->\n\nMeasured")
    assert page.endswith("\n\n<!-- end of results -->\nafter\n")
    assert results.filled(page, tmp_path) == page
    assert "\n| problems solved by both | 7 |" in page
    assert "\n| travel time above it, most | 0.412% |" in page
    assert "2.00% above the optimum: steep &#124; icy" in page
    assert "(results/optimality.json)" in page


@pytest.mark.parametrize(
    ("name", "result", "message"),
    [
        ("cycle.json", OPTIMALITY, "a place for cycle"),
        ("optimality.json", {"seconds": 1}, "writes now"),
        ("optimality.json", [], "writes now"),
    ],
)
def test_a_result_that_does_not_fit_is_named(
    tmp_path: Path, name: str, result: object, message: str
) -> None:
    put(tmp_path, name, result)
    with pytest.raises(results.ResultError, match=message) as error:
        results.filled(PAGE, tmp_path)
    assert name in str(error.value)


def test_the_page_is_what_the_script_writes() -> None:
    page = (DOCS / "benchmarks.md").read_text()
    assert results.filled(page, DOCS / "results") == page, "`make docs` writes the tables"


ROOT = Path(__file__).parents[2]
UNMODELLED = (ROOT / "docs" / "not-modelled.md").read_text()


def stop(name: str, *, down: bool = True) -> Stop:
    model = read_model(find_model(name))
    return Stop(model, model.braking.grade_range[0] if down else 0.0)


def row(rows: tuple[Row, ...], name: str) -> Row:
    return next(left for left in rows if left.name == name)


def test_the_page_has_the_tables_of_the_script(tmp_path: Path) -> None:
    assert not_modelled.tables() in UNMODELLED
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- tables -->\nold\n<!-- end of tables -->\nb\n")
    command = [sys.executable, "-m", "examples.not_modelled", "--into", str(page)]
    subprocess.run(command, cwd=ROOT, check=True, timeout=60)
    expected = f"a\n<!-- tables -->\n{not_modelled.tables()}<!-- end of tables -->\nb\n"
    assert page.read_text() == expected


@pytest.mark.parametrize("name", NAMES)
def test_stops_of_the_script_are_those_by_hand(name: str) -> None:
    left = stop(name)
    b = left.model.braking
    v, theta = left.speed, b.grade_range[0]
    force = (b.m_m * v + b.b_m) * theta + b.m_b * v + b.b_b
    braked = v * v / (2.0 * 9.80665 * (force + math.sin(theta)))
    assert left.longer(force=-0.01) == pytest.approx(
        v * v / (2.0 * 9.80665 * (force - 0.01 + math.sin(theta))) - braked
    )
    assert left.longer(dead_time=0.1) == pytest.approx(0.1 * v)
    assert row(METRES, "slow build-up of the force").value(left) == pytest.approx(0.1 * v)
    assert left.longer(force=-force) == math.inf


@pytest.mark.parametrize("left", [*METRES, *LOADS], ids=lambda left: left.name)
def test_what_a_row_says_it_does_its_number_does(left: Row) -> None:
    for name in NAMES:
        value = left.value(stop(name))
        if left.does.startswith("longer") and "shorter" not in left.does:
            assert value > 0.0
        if left.does.startswith("shorter"):
            assert value < 0.0
    assert re.search(rf"^\| {re.escape(left.name)} \|", UNMODELLED, re.MULTILINE)


def test_a_vehicle_of_ones_own_has_a_column(tmp_path: Path) -> None:
    model_file = tmp_path / "own.toml"
    model_file.write_text(find_model("atv").read_text().replace('name = "atv"', 'name = "mine"'))
    text = not_modelled.tables(("ugv", str(model_file)))
    assert "| not modelled | size | formula | ugv | mine | does |" in text
    assert "husky" not in text


def test_no_min_load_keeps_the_payload() -> None:
    """The sentence below the tables."""
    for name in ("atv", "husky"):
        left = stop(name)
        ahead = row(LOADS, "payload farther to the front").value(left)
        assert ahead + row(LOADS, "payload higher").value(left) > left.model.limits.min_load == 0.1
    ahead, level = stop("husky"), stop("husky", down=False)
    longer = row(METRES, "hot brakes")
    assert longer.value(ahead) > 20.0 * longer.value(level)
