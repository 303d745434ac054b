"""`make` finds a Python that can run slopewise, or says what to install."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.docs.shown import ROOT

BROKEN = "echo 'pyenv: python: command not found' >&2; exit 127"
TOO_OLD = "exit 1"
FINE = "exit 0"


def make_demo(
    folder: Path, pythons: Mapping[str, str], *options: str
) -> subprocess.CompletedProcess[str]:
    """Dry run of `make demo` with these as the only programs on the path."""
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    for name, does in pythons.items():
        (folder / name).write_text(f"#!/bin/sh\n{does}\n")
        (folder / name).chmod(0o755)
    return subprocess.run(
        [make, "-n", "demo", f"VENV={folder}/venv", *options],
        cwd=ROOT,
        env={"PATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize(
    ("pythons", "chosen"),
    [
        ({"python3.11": FINE, "python3.12": FINE}, "python3.11"),
        ({"python3.11": BROKEN, "python3.12": FINE, "python3": FINE}, "python3.12"),
        ({"python3.11": BROKEN, "python3.12": BROKEN, "python3.13": FINE}, "python3.13"),
        ({"python3.12": BROKEN, "python3": FINE}, "python3"),
    ],
)
def test_the_first_python_that_runs_is_taken(
    pythons: dict[str, str], chosen: str, tmp_path: Path
) -> None:
    done = make_demo(tmp_path, pythons)
    assert done.stdout.startswith(f"{chosen} -m venv "), (done.stdout, done.stderr)


def test_a_python_that_is_named_is_taken(tmp_path: Path) -> None:
    done = make_demo(tmp_path, {"python3.11": FINE}, "PYTHON=/opt/python")
    assert done.stdout.startswith("/opt/python -m venv ")


def test_without_one_a_line_says_what_to_install(tmp_path: Path) -> None:
    done = make_demo(tmp_path, {"python3.12": BROKEN, "python3": TOO_OLD})
    assert (done.returncode, done.stdout) == (2, "")
    assert "no Python of at least 3.11 runs here: install one" in done.stderr
    assert done.stderr.count("\n") == 1
