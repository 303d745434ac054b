"""The compiler of this machine with one more option, and the C++ core without Python."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / "planner" / "core"

LONGER = "SLOPEWISE_FUZZ_SECONDS"
"""Environment variable: seconds for each program, e.g. of a night."""


def compiler_with(option: str, folder: Path) -> dict[str, str]:
    """Environment in which the core is compiled with an option that prevails over its own."""
    compiler = shutil.which("c++")
    if compiler is None:
        return {}  # hatch_build.py finds another one
    script = folder / "c++"
    script.write_text(f'#!/bin/sh\nexec "{compiler}" "$@" {option}\n')
    script.chmod(0o755)
    return {"CXX": str(script)}


def run_under_sanitizers(driver: Path, folder: Path, seconds: int = 2) -> None:
    """Build a program in an empty folder and let it run for a number of seconds."""
    if not all(map(shutil.which, ("c++", "cmake", "ninja"))):
        pytest.skip("no compiler with sanitizers on the path")
    seconds = int(os.environ.get(LONGER, seconds))
    # Reports need lines of the sources, not values of variables.
    environment = os.environ | compiler_with("-g1", folder)
    build = folder / "build"
    source = f"-DSLOPEWISE_DRIVER={driver}"
    for command in (
        ["cmake", "-G", "Ninja", "-S", str(CORE), "-B", str(build), source],
        ["cmake", "--build", str(build)],
        [str(build / "driver"), str(seconds)],
    ):
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=500 + seconds, env=environment
        )
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
