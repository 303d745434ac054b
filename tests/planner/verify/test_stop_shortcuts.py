"""Stops that are neither marched nor checked for their loads, against those that are."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.world.compilers import CORE

SOURCE = Path(__file__).with_name("stop_shortcuts.cpp")


@pytest.mark.skipif(shutil.which("c++") is None, reason="no compiler on the path")
def test_shortcuts_pass_no_stop_that_unloads_anything(tmp_path: Path) -> None:
    program = str(tmp_path / "stop_shortcuts")
    options = ["-std=c++20", "-O1", "-ffp-contract=off", f"-I{CORE}"]
    subprocess.run(["c++", *options, str(SOURCE), "-o", program], check=True, timeout=200)
    done = subprocess.run([program], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout
