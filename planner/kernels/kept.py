"""Compiled code on disk: is it all there, can it be, and is another process making it?"""

from __future__ import annotations

import fcntl
import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import IO, Any

import numba
from llvmlite import binding
from numba.core import config
from numba.misc.appdirs import AppDirs

from slopewise import models
from slopewise.planner.kernels.stale import digest_of

PACKAGE = Path(__file__).parents[1]

_config: Any = config
_places: Any = AppDirs


def is_compiled() -> bool:
    """All that plans need was compiled here, from these sources and for this machine.

    Where numba is told to compile nothing (`NUMBA_DISABLE_JIT`), nothing is missing.
    """
    if _config.DISABLE_JIT:
        return True
    note = _note()
    return note is not None and note.is_file() and note.read_text() == _made_with()


def note_compiled() -> None:
    """From now on :func:`is_compiled` holds, until the sources change."""
    if note := _note():
        note.write_text(_made_with())


def count() -> int:
    """Kernels that are compiled up to now, of this installation or of all in one folder."""
    folder = _folder()
    if folder is None:
        return 0
    return sum(1 for _ in (PACKAGE if folder.parent == PACKAGE else folder).rglob("*.nbi"))


def can_be_kept() -> bool:
    """Compiled code stays for those who come later."""
    return _folder() is not None


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
    folder = _folder()
    if folder is None:
        raise OSError("compiled code cannot be kept anywhere")
    return (folder / "compiling.lock").open("a")


def _folder() -> Path | None:
    """The first of numba's places that can be written to; None if there is none."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    of_user: str = _places(appname="numba", appauthor=False).user_cache_dir
    for place in (given, PACKAGE / "__pycache__", of_user):
        with suppress(OSError):
            if place and (folder := Path(place)):
                folder.mkdir(parents=True, exist_ok=True)
                if os.access(folder, os.W_OK):
                    return folder
    return None


def _note() -> Path | None:
    """Of this installation; others may keep their code in the same folder."""
    folder, name = _folder(), hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:16]
    return folder and folder / f"compiled-{name}"


@cache
def _made_with() -> str:
    """Changes with the sources, the compiler and the processor."""
    sources = digest_of(PACKAGE, Path(models.__file__ or "").parent)
    return f"{sources} {sys.version} {numba.__version__} {binding.get_host_cpu_name()}"
