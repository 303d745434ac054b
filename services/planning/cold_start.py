"""Kernels are compiled before the first plan of an installation, and whoever waits is told."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable

from planner.kernels.ahead import compile_ahead, written_down
from planner.kernels.compiled import is_first_run

ALONE = (
    "plan", "swept", "bounds", "profile", "pipeline", "verify.judge", "verify.track",
    "ground.terrain_profile:_sample", "ground.vertical_curvature",
    "ground.forces:_forces_on_one_surface", "ground.grade_between",
)  # fmt: skip
"""Kernels that every plan needs; the others are for several surfaces and for robots that drive."""

SURFACES = "ground"
"""What a map with surfaces needs beside them."""


def compile_first(meanwhile: str, begins: Iterable[str] = ("",)) -> None:
    """Compile on all cores if nothing is compiled yet, and say so in one line on standard error.

    Args:
        meanwhile: what the one who waits should know.
        begins: how the names of the kernels begin that are needed, all by default.

    The compiler's memory is that of other processes. Where the code cannot be kept this one has to
    compile it anyway, and only the line is said.
    """
    if is_first_run():
        words = f"slopewise: compiling, once after each installation; {meanwhile}"
        print(words, file=sys.stderr, flush=True)
        folder = os.environ.get("NUMBA_CACHE_DIR")
        if folder is None or os.access(folder, os.W_OK):
            compile_ahead(written_down(begins))
