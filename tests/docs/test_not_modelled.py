"""The page of what is not modelled: its numbers and sentences are those of the script."""

from __future__ import annotations

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

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "not-modelled.md").read_text()


def stop(name: str, *, down: bool = True) -> Stop:
    model = read_model(find_model(name))
    return Stop(model, model.braking.grade_range[0] if down else 0.0)


def row(rows: tuple[Row, ...], name: str) -> Row:
    return next(left for left in rows if left.name == name)


def test_the_page_has_the_tables_of_the_script(tmp_path: Path) -> None:
    assert not_modelled.tables() in PAGE
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
    assert re.search(rf"^\| {re.escape(left.name)} \|", PAGE, re.MULTILINE)


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
