"""A foreign package in the place of an own one is named in one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def importing(folder: Path, script: str = "import slopewise") -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
    return subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize("name", ["models", "planner", "services"])
@pytest.mark.parametrize("file", ["{}/__init__.py", "{}.py"])
def test_a_foreign_package_is_named_with_its_file(tmp_path: Path, name: str, file: str) -> None:
    foreign = tmp_path / file.format(name)
    foreign.parent.mkdir(exist_ok=True)
    foreign.write_text("raise AssertionError('it is not even imported')")
    done = importing(tmp_path)
    assert done.returncode == 1
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"ImportError: slopewise needs its own package '{name}'")
    assert str(foreign) in said


def test_a_foreign_package_that_was_imported_before_is_named(tmp_path: Path) -> None:
    (tmp_path / "models.py").touch()
    script = f"import sys, models; sys.path.remove({str(tmp_path)!r}); import slopewise"
    said = importing(tmp_path, script).stderr.splitlines()[-1]
    assert str(tmp_path / "models.py") in said


def test_the_command_says_so_too(tmp_path: Path) -> None:
    (tmp_path / "services.py").touch()
    script = "from slopewise.__main__ import main; main()"
    said = importing(tmp_path, script).stderr.splitlines()[-1]
    assert said.startswith("ImportError: slopewise needs its own package 'services'")


def test_a_folder_that_is_no_package_is_not_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    script = "import slopewise; print(slopewise.Model.__module__)"
    assert importing(tmp_path, script).stdout == "models.parameters\n"
