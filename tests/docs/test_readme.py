"""What README shows works after `pip install .` alone: its commands, with all extras out of reach.

The extras are installed here, so a start-up file hides each module that the core does not need.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from services.io.table import write_csv
from tests.models.calibration.plant import Plant, drive

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
BOX = re.compile(r"^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
CORE = ("plan", "check", "calibrate", "discrepancy")
"""Commands of the boxes that need no further installation."""

HIDE = """
import os, sys
for name in os.environ.get("HIDDEN_MODULES", "").split(","):
    sys.modules[name] = None
"""


def core() -> set[str]:
    """Distributions that a plain install brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found = {_name(project["name"])}  # an editable install lists its own modules, too
    left = [_name(line) for line in project["dependencies"]]
    while left:
        name = left.pop()
        if name in found:
            continue
        found.add(name)
        try:
            needs = requires(name) or []
        except PackageNotFoundError:
            continue
        left += [_name(line) for line in needs if "extra ==" not in line]
    return found


def _name(line: str) -> str:
    match = re.match(r"[A-Za-z0-9._-]+", line)
    assert match, line
    return re.sub(r"[-_.]+", "-", match.group()).lower()


def hidden() -> list[str]:
    kept = core()
    return sorted(
        module
        for module, names in packages_distributions().items()
        if module.isidentifier() and not any(_name(name) in kept for name in names)
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, paths and a drive log under the names that README gives them."""
    place = tmp_path_factory.mktemp("readme")
    (place / "sitecustomize.py").write_text(HIDE)
    (place / "examples").symlink_to(ROOT / "examples")
    x, y = np.meshgrid(np.arange(120.0), np.arange(120.0))
    height = (2.0 * np.sin(x / 14.0) + 1.5 * np.cos(y / 17.0)).astype(np.float32)
    with rasterio.open(
        place / "dem.tif", "w", driver="GTiff", width=120, height=120, count=1, dtype="float32",
        crs="EPSG:32632", transform=from_origin(5e5, 5e6, 1.0, 1.0),
    ) as file:  # fmt: skip
        file.write(height, 1)
    along = np.linspace(0.0, 40.0, 41)
    write_csv({"x": 5e5 + 40.0 + along, "y": 5e6 - 60.0 + 0.1 * along}, place / "paths.csv")
    log = drive(Plant(), 40, 0)[0]
    columns = {n: list(v) if v.dtype.kind == "U" else v for n, v in log.items()}
    write_csv(columns, place / "drive.csv")
    return place


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    search = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=600,
        env=os.environ | {"PYTHONPATH": search, "HIDDEN_MODULES": ",".join(hidden())},
    )  # fmt: skip


def test_the_extras_are_out_of_reach(folder: Path) -> None:
    assert {"plotly", "sklearn", "polars", "rosbags"} & set(hidden())
    assert not {"numpy", "matplotlib", "zenoh", "rasterio"} & set(hidden())
    done = run(folder, sys.executable, "-c", "import plotly")
    assert "ModuleNotFoundError" in done.stderr


def test_every_command_of_a_plain_install_works(folder: Path) -> None:
    lines = [line for box in BOX.finditer(README) for line in box["text"].splitlines()]
    shown = [words.split() for words in lines if words.startswith("slopewise ")]
    commands = [words for words in shown if words[1] in CORE]
    # In the text, not in a box.
    commands.insert(1, ["slopewise", "check", "plan.csv", "--map", "dem.tif", "--model", "atv"])
    assert {words[1] for words in commands} == set(CORE)
    for words in commands:
        done = run(folder, sys.executable, "-m", *words)
        assert done.returncode in (0, 3), f"{words}: {done.stdout}{done.stderr}"
        assert "pip install" not in done.stderr
    for name in ("plan.csv", "plan.html", "mine.toml", "stops.html", "brakes.pdf", "found"):
        assert (folder / name).exists(), name


def test_the_program_of_the_page_works(folder: Path) -> None:
    (box,) = [box["text"] for box in BOX.finditer(README) if box["kind"] == "python"]
    done = run(folder, sys.executable, "-c", box)
    assert done.returncode == 0, done.stderr
    assert re.search(r"(ok|blocked|degraded) \d", done.stdout), done.stdout


def test_the_example_of_the_page_works(folder: Path) -> None:
    done = run(folder, sys.executable, "examples/across_a_dem.py", "dem.tif")
    assert done.returncode in (0, 3), done.stderr
    assert "towards 90°" in done.stdout
