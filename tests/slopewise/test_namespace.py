"""slopewise is one package: it uses no common name, and others may use them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

NAMES = ("models", "planner", "services", "benchmarks", "configs")


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder with packages of those names of another project."""
    for name in NAMES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise AssertionError('foreign {name}')")
    return tmp_path


def run(folder: Path, *arguments: str) -> str:
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


FIRST = """
import numpy as np
import slopewise

ground = slopewise.ElevationMap(elevation=np.zeros((40, 100)), resolution=0.5, origin=(0, 0))
path = slopewise.CandidatePath("straight", np.array([[5.0, 10.0], [30.0, 10.0]]))
model = slopewise.read_model("atv")
(plan,) = slopewise.plan(model, ground, [path])
assert slopewise.check_plan(plan, model, ground).valid
state = slopewise.PlanarState(x=5, y=10, heading=0, speed=0)
answer = slopewise.Horizon(model).step(state, [path], ground)
print(plan.status.value, answer.command.stop, slopewise.Model.__module__)
"""


def test_it_plans_at_once_in_a_folder_with_foreign_packages(workspace: Path) -> None:
    assert run(workspace, "-c", FIRST) == "ok False slopewise.models.parameters\n"


def test_the_command_works_there(workspace: Path) -> None:
    out = run(workspace, "-m", "slopewise", "demo", "--out", "demo")
    assert "candidates" in out
