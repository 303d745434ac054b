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
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_plans_in_a_folder_with_foreign_packages(workspace: Path) -> None:
    script = (
        "import numpy as np, slopewise\n"
        "level = np.zeros((40, 80))\n"
        "ground = slopewise.ElevationMap(elevation=level, resolution=0.5, origin=(0.0, 0.0))\n"
        "east = np.array([[5.0, 10.0], [30.0, 10.0]])\n"
        "path = slopewise.CandidatePath(name='east', points=east)\n"
        "(plan,) = slopewise.plan(slopewise.read_model('atv'), ground, [path])\n"
        "print(plan.status.value, slopewise.Model.__module__)"
    )
    assert run(workspace, "-c", script) == "ok slopewise.models.parameters\n"


def test_the_command_works_there(workspace: Path) -> None:
    out = run(workspace, "-m", "slopewise", "demo", "--out", "demo")
    assert "candidates" in out
