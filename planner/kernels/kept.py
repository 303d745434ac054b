"""Compiled code on disk: is there any, can there be, and is another process making it?"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

_PACKAGE = Path(__file__).parents[1]


def is_first_run() -> bool:
    """Nothing is compiled yet, wherever it is kept: the first plan waits for the compiler."""
    if folder := os.environ.get("NUMBA_CACHE_DIR"):
        return not any(Path(folder).glob("**/*.nbi"))
    return can_be_kept() and not any(_PACKAGE.glob("*/__pycache__/*.nbi"))


def can_be_kept() -> bool:
    """Compiled code stays for those who come later."""
    return os.access(os.environ.get("NUMBA_CACHE_DIR") or _PACKAGE, os.W_OK)


@contextmanager
def compiling() -> Iterator[None]:
    """Wait until no other process compiles; within, none does. One that is killed gives way.

    Raises:
        OSError: compiled code cannot be kept.
    """
    with _turn() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def is_compiling() -> bool:
    """Another process compiles now."""
    if not can_be_kept():
        return False
    with _turn() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _turn() -> IO[str]:
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or _PACKAGE / "__pycache__")
    folder.mkdir(exist_ok=True)
    return (folder / "compiling.lock").open("a")
