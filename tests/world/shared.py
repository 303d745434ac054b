"""Results that are expensive and the same for all workers: the first that asks computes them."""

from __future__ import annotations

import fcntl
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
FOLDERS: list[Path] = []
"""The folder that the workers of this run have in common, if there are any: set by conftest.py."""


def once(name: str, compute: Callable[[], T]) -> T:
    """The result of a computation, or what the worker that came first has got."""
    if not FOLDERS:
        return compute()
    file = FOLDERS[0] / f"{name}.pickle"
    with file.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not file.exists():
            import cloudpickle  # of the extra fleet; takes read-only mappings

            part = file.with_suffix(".part")
            part.write_bytes(cloudpickle.dumps(compute()))
            part.rename(file)
        result: T = pickle.loads(file.read_bytes())
        return result
