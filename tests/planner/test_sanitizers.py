"""Random input through the core under sanitizers: the whole planner, and the given paths.

By night its bounds and its verifier as well: only there effects move a vehicle while it stops. The
whole planner, as C++ programs have it, knows none.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from hatch_build import tool
from tests.world.compilers import CORE, compiler_with, needs_compiler

HERE = Path(__file__).parent
BY_DAY = ("planner_driver.cpp", "path_driver.cpp")
BY_NIGHT = ("bounds/core_driver.cpp", "verify/verify_driver.cpp")
SECONDS = int(os.environ.get("SLOPEWISE_FUZZ_SECONDS", 1))
"""For each program; more of a night."""
# Reports need lines of the sources, not values of variables. What is not optimised compiles in a
# share of the time and runs for some times as long: by day the compiler is what costs.
OPTIONS = "-g1" if "SLOPEWISE_FUZZ_SECONDS" in os.environ else "-O0 -g1"


@needs_compiler
@pytest.mark.parametrize(
    "driver", [*BY_DAY, *(pytest.param(d, marks=pytest.mark.nightly) for d in BY_NIGHT)]
)
def test_random_input_passes_the_sanitizers(driver: str, tmp_path: Path) -> None:
    environment = os.environ | compiler_with(OPTIONS, tmp_path)
    build = tmp_path / "build"
    source = f"-DSLOPEWISE_DRIVER={HERE / driver}"
    cmake, ninja = str(tool("cmake")), f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"
    for command in (
        [cmake, "-G", "Ninja", "-S", str(CORE), "-B", str(build), source, ninja],
        [cmake, "--build", str(build)],
        [str(build / "driver"), str(SECONDS)],
    ):
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=500 + SECONDS, env=environment
        )
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
