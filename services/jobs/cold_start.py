"""Plans before the kernels of an installation are compiled, and messages about the wait.

Compiling takes a minute. A plan of a few paths is ready sooner if its kernels run as Python, while
a separate process compiles for later ones.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TypeVar

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.planner.kernels import kept
from slopewise.planner.kernels.ahead import compile_ahead, written_down
from slopewise.planner.kernels.interpreted import interpret, is_interpreting
from slopewise.planner.path import EvenPath, PathBatch
from slopewise.services.jobs.progress import progress_bar

FEW = 3000
"""Stations that Python plans along sooner than the compiler is done, at some 15 ms each."""

_POLL_INTERVAL = 0.2
"""Time between two checks whether another process has compiled everything [s]."""

_NOWHERE = (
    "compiling, a minute for each process: compiled code cannot be kept here; let NUMBA_CACHE_DIR "
    "name a folder that can be written to"
)
_IN_PYTHON = (
    "compiling, once after each installation; until that is done plans are made in Python, which "
    "takes seconds instead of milliseconds"
)
_COMPILER = (
    "import os, sys; os.nice(10); sys.path[:] = {path!r}; sys.argv[1:] = ['warm-up']; "
    "from slopewise.__main__ import main; main()"
)

T = TypeVar("T")

_changed = threading.Condition()
_running = 0
"""Jobs of this process that run now, all of them as Python or all compiled."""
_compiler: subprocess.Popen[bytes] | None = None


def compile_first(meanwhile: str) -> None:
    """Compile on all cores what is not compiled yet, and say so in one line on standard error.

    The compiler's memory is that of other processes. Where the code cannot be kept this one has to
    compile it anyway, and only the line is printed.
    """
    if kept.is_compiled():
        return
    if not kept.can_be_kept():
        _print_once(_NOWHERE)
        return
    _print_once(f"compiling, once after each installation; {meanwhile}")
    with kept.compiling():
        if not kept.is_compiled():
            kernels = written_down()
            with progress_bar("compiling", len(kernels)) as advance:
                left = compile_ahead(kernels, advance)
            if len(left) < len(kernels):
                kept.note_compiled()


def sooner(job: Callable[[], T], stations: Callable[[], float]) -> T:
    """Run a planning job, in Python where the compiler would take longer, as another one compiles.

    The first job after that finds everything compiled. A job must not begin another one; it may be
    done twice: where Python has no number but an error, the compiler is waited for. It plans along
    that many stations, NaN for a path that is refused anyway.
    """
    with _joined(_prefers_python) as in_python:
        if not in_python:
            return job()
        try:
            if not stations() > FEW:
                return job()
        except ParameterError:
            raise
        except (ArithmeticError, ValueError):
            pass
    _wait()
    with _joined(lambda: False):
        return job()


@contextmanager
def _joined(prefers_python: Callable[[], bool]) -> Iterator[bool]:
    """Take a place among the jobs that run; yields whether all of them run as Python.

    Kernels change over between jobs only: half a plan in Python would call from there what kernels
    alone may call. So a job that needs the other kind waits until those that run are done.
    """
    global _running
    with _changed:
        while (in_python := prefers_python()) != is_interpreting() and _running:
            _changed.wait()
        interpret(in_python)
        _running += 1
    try:
        yield in_python
    finally:
        with _changed:
            _running -= 1
            _changed.notify_all()


def stations_of(paths: PathBatch | Sequence[CandidatePath | EvenPath], spacing: float) -> float:
    """About how many stations so far apart [m] paths have together."""
    if isinstance(paths, PathBatch):
        return float(paths.count.sum())
    lengths = [np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum() for path in paths]
    return float(sum(lengths)) / spacing


def _prefers_python() -> bool:
    """Whether a job had better run as Python: as long as another process compiles."""
    global _compiler
    if kept.is_compiled():
        return False
    if not kept.can_be_kept():
        _print_once(_NOWHERE)
        return False
    _print_once(_IN_PYTHON)
    if not kept.is_compiling():
        if _compiler is None:
            # It has to import this very copy from any working directory.
            path = [str(kept.PACKAGE.parents[1]), *sys.path]
            quiet = subprocess.DEVNULL
            _compiler = subprocess.Popen(
                [sys.executable, "-P", "-c", _COMPILER.format(path=path)],
                stdin=quiet,
                stdout=quiet,
                stderr=quiet,
                start_new_session=True,
            )
        elif _compiler.poll() is not None:
            # It ended before it was done. What is missing is compiled where it is called.
            return False
    return True


def _is_compiling() -> bool:
    return kept.is_compiling() or (_compiler is not None and _compiler.poll() is None)


def _wait() -> None:
    """Until another process has compiled everything, or has ended."""
    total, seen = len(written_down()), 0
    with progress_bar("compiling", total) as advance:
        while not kept.is_compiled() and _is_compiling():
            advance(-seen + (seen := min(kept.count(), total)))
            time.sleep(_POLL_INTERVAL)


@cache
def _print_once(text: str) -> None:
    print(f"slopewise: {text}", file=sys.stderr, flush=True)
