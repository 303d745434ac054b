"""What an installation does before its kernels are compiled, and whoever waits is told.

Compiling takes a minute. A plan of a few paths is there sooner when its kernels run as Python, and
a process of its own compiles for the next one meanwhile.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from typing import TypeVar

from models.errors import ParameterError
from planner.kernels.ahead import compile_ahead, written_down
from planner.kernels.interpreted import interpret
from planner.kernels.kept import can_be_kept, compiling, is_compiling, is_first_run

ALONE = (
    "plan", "swept", "bounds", "profile", "pipeline", "verify.judge", "verify.track",
    "ground.terrain_profile:_sample", "ground.vertical_curvature",
    "ground.forces:_forces_on_one_surface", "ground.grade_between",
    "path_deviation:deviation_along",
)  # fmt: skip
"""Kernels that every plan needs; the others are for several surfaces and for robots that drive."""

SURFACES = "ground"
"""What a map with surfaces needs beside them."""

FEW = 800
"""Stations that Python plans along much sooner than the compiler is done, at some 15 ms each."""

T = TypeVar("T")


def compile_first(meanwhile: str, begins: Iterable[str] = ("",)) -> None:
    """Compile on all cores if nothing is compiled yet, and say so in one line on standard error.

    Args:
        meanwhile: what the one who waits should know.
        begins: how the names of the kernels begin that are needed, all by default.

    The compiler's memory is that of other processes. Where the code cannot be kept this one has to
    compile it anyway, and only the line is said.
    """
    if is_first_run() or is_compiling():
        _say(f"compiling, once after each installation; {meanwhile}")
        if can_be_kept():
            with compiling():
                if is_first_run():
                    compile_ahead(written_down(begins))


def sooner(job: Callable[[], T], stations: float, begins: Iterable[str] = ("",)) -> T:
    """Do what plans along so many stations, in Python where the compiler would take longer.

    This process stays in Python then, and another one compiles.

    Args:
        job: may be done twice: where Python has no number but an error, the compiler is waited for.
        stations: NaN for a path that is refused anyway.
        begins: as of :func:`compile_first`.
    """
    wait = "plans come after that (slopewise warm-up does it ahead)"
    if stations > FEW or not can_be_kept() or not (is_first_run() or is_compiling()):
        compile_first(wait, begins)
        return job()
    _compile_meanwhile()
    interpret(True)
    try:
        return job()
    except ParameterError:
        raise
    except (ArithmeticError, ValueError):
        interpret(False)
        compile_first(wait, begins)
        return job()


def _compile_meanwhile() -> None:
    words = "compiling, once after each installation; until that is done plans are made in Python"
    _say(f"{words}, which takes seconds instead of milliseconds")
    if not is_compiling():
        command = [sys.executable, "-m", "slopewise", "warm-up"]
        quiet = subprocess.DEVNULL
        subprocess.Popen(
            command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True,
            preexec_fn=lambda: os.nice(10),
        )  # fmt: skip


def _say(words: str) -> None:
    print(f"slopewise: {words}", file=sys.stderr, flush=True)
