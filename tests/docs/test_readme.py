"""Every command that README and the quick start show works, with what the page says to install."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import slopewise
from examples import made_up
from slopewise.services.io.table import write_csv
from tests.docs.player import playing
from tests.docs.shown import BOX, ROOT, environment, hidden, in_text, shown
from tests.models.terrain import plant
from tests.services.fleet_inputs import paths_file, tiled_map
from tests.services.warm_process import WarmProcess

README = (ROOT / "README.md").read_text()
QUICK_START = (ROOT / "docs" / "quickstart.md").read_text()
PAGES = {"README": README, "quick start": QUICK_START}
IN_README = {command.line for command in shown(README)}
"""What the quick start shows as well is run once."""
SECTIONS = sorted(
    {
        (page, command.section)
        for page, text in PAGES.items()
        for command in shown(text)
        if page == "README" or command.line not in IN_README
    }
)
NEEDS = {
    "viz": ("foxglove",),
    "fleet": ("distributed", "pyarrow"),
    "ros": ("rosbags",),
    "service": ("waitress",),
}


def inputs(folder: Path) -> None:
    """Files of a reader of README: a map, paths, logs of one vehicle and of a fleet."""
    made_up.main(folder)
    skid = plant.drive(plant.square(sides=2), plant.DIRT)
    write_csv({"run": ["1"] * len(skid["t"]), **skid}, folder / "husky.csv")
    tiled_map(folder / "county.tif")
    (folder / "logs").mkdir()
    # Twelve are enough to search in, eight to calibrate; thirty take three times as long.
    for seed, (name, stops) in enumerate(
        {"drive": 14, "logs/robot-0": 12, "logs/robot-1": 8}.items()
    ):
        log = made_up.stops(stops, seed=seed)
        runs = [f"{run:.0f}" for run in log.pop("run")]
        write_csv({"run": runs, **log}, folder / f"{name}.csv")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("readme") / "inputs"
    inputs(folder)
    return folder


@pytest.mark.parametrize(("page", "section"), SECTIONS)
def test_what_a_section_shows_works(page: str, section: str, place: Path, tmp_path: Path) -> None:
    lines = [command for command in shown(PAGES[page]) if command.section == section]
    extras = {extra for command in lines for extra in command.extras}
    for module in [module for extra in extras for module in NEEDS.get(extra, ())]:
        pytest.importorskip(module, reason=f"{module} is not installed")
    folder = tmp_path / "here"
    shutil.copytree(place, folder)
    if any("parquet" in command.line for command in lines):
        paths_file(folder / "paths-1.parquet", 6, seed=1)
    with playing(folder) as player:
        if any(command.line.startswith("slopewise ros") for command in lines):
            player.router()
        for command in lines:
            player.play(command)
        for line, printed in player.exports.items():
            assert "across_a_dem" not in line or "towards 90°" in printed
            assert "mock_navigation" not in line or "m driven" in printed


def test_the_pages_show_all_that_matters() -> None:
    names = {
        command.arguments[1] for command in shown(README) if command.arguments[0] == "slopewise"
    }
    expected = "plan check calibrate terrain discrepancy fleet serve replay params ros guard export"
    assert names >= set(expected.split())
    assert {"plan", "check"} <= {command.arguments[1] for command in shown(QUICK_START)}


@pytest.mark.parametrize("page", PAGES)
def test_commands_with_arguments_stand_in_boxes(page: str) -> None:
    assert not in_text(PAGES[page])


def test_they_are_out_of_reach_of_forked_commands_too(tmp_path: Path) -> None:
    """The server that forks the commands must not have imported modules of an extra."""
    asks = (
        "import sys, numpy\nfor name in sys.argv[1:]:\n    assert sys.modules[name] is None, name\n"
    )
    (tmp_path / "asks.py").write_text(f"{asks}import pyarrow\n")
    program, missing = [sys.executable, "asks.py", *hidden()], hidden()
    process = WarmProcess(program, environment(tmp_path), folder=tmp_path, hidden=missing)
    assert "ModuleNotFoundError" in process.finished(60.0).stderr
    (tmp_path / "asks.py").write_text("")
    process = WarmProcess(program[:2], environment(tmp_path), folder=tmp_path, hidden=["numpy"])
    assert "cannot be hidden: ['numpy']" in process.finished(60.0).stderr


def test_the_program_of_the_page_works(place: Path) -> None:
    (box,) = [box["text"] for box in BOX.finditer(README) if box["kind"] == "python"]
    (place / "box.py").write_text(box)
    program = [sys.executable, "box.py"]
    done = WarmProcess(program, environment(place), folder=place, hidden=hidden()).finished(100.0)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^straight ok \d", done.stdout, re.MULTILINE), done.stdout
    assert re.sub(r"\s+", " ", box.split("\n\n")[1]) in re.sub(r"\s+", " ", slopewise.__doc__ or "")


def test_the_made_up_log_is_what_its_example_says(place: Path) -> None:
    """By a line through decelerations, without the project's own fit."""
    log = made_up.stops(60)
    force, grade = [], []
    for number in range(60):
        at = log["run"] == number
        t, v = log["t"][at], log["v"][at]
        command_time = t[np.argmax(log["v_cmd"][at] == 0.0)] + made_up.DEAD_TIME
        moving = (t > command_time) & (v > 0.1)
        slowing = -np.polyfit(t[moving], v[moving], 1)[0]
        grade.append(-np.mean(log["pitch"][at]))
        force.append(slowing / 9.80665 - np.sin(grade[-1]))
    slope, level = np.polyfit(grade, force, 1)
    assert level == pytest.approx(0.40, abs=0.005)
    assert slope == pytest.approx(-0.2, abs=0.03)
