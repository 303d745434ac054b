"""Random scenes through the sweep and the roughness of the core, under sanitizers."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
CORE = HERE.parents[2] / "planner" / "core"


def test_random_scenes_pass_the_sanitizers(tmp_path: Path) -> None:
    if not all(map(shutil.which, ("c++", "cmake", "ninja"))):
        pytest.skip("no compiler with sanitizers on the path")
    driver = f"-DSLOPEWISE_DRIVER={HERE / 'swept_driver.cpp'}"
    for command in (
        ["cmake", "-G", "Ninja", "-S", str(CORE), "-B", str(tmp_path), driver],
        ["cmake", "--build", str(tmp_path)],
        [str(tmp_path / "driver"), "8"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
