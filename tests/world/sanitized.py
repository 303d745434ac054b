"""Programs that call the C++ core without Python, built with sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / "planner" / "core"


LONGER = "SLOPEWISE_FUZZ_SECONDS"
"""Environment variable: seconds for each program, e.g. of a night."""


def run_under_sanitizers(driver: Path, seconds: int, folder: Path) -> None:
    """Build a program in an empty folder and let it run for a number of seconds."""
    if not all(map(shutil.which, ("c++", "cmake", "ninja"))):
        pytest.skip("no compiler with sanitizers on the path")
    seconds = int(os.environ.get(LONGER, seconds))
    source = f"-DSLOPEWISE_DRIVER={driver}"
    for command in (
        ["cmake", "-G", "Ninja", "-S", str(CORE), "-B", str(folder), source],
        ["cmake", "--build", str(folder)],
        [str(folder / "driver"), str(seconds)],
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=500 + seconds)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
