"""Compile kernels before they are called, on all cores at once.

numba compiles a kernel when it is first called, one after the other: which numbers it is called
with is known only then. With them written down (`signatures.json`) several processes compile
different kernels at the same time into the cache on disk. What is not written down, or no longer
true, is compiled as ever, where it is called.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
from numba.core import types
from numba.np.numpy_support import as_dtype, from_dtype

_WRITTEN_DOWN = Path(__file__).parent / "signatures.json"

_tuple_of: Any = types.BaseTuple.from_types

Signatures = dict[str, list[Any]]
"""Of each kernel `module:name` its signatures, each a list of :func:`described` types."""


def written_down() -> Signatures:
    """Kernels that plans need, the longest to compile first."""
    known: Signatures = json.loads(_WRITTEN_DOWN.read_text())
    return known


def compile_ahead(signatures: Signatures, progress: Callable[[int], None]) -> list[str]:
    """Compile kernels into the cache on disk, as many at once as there are cores.

    No compiling process outlives this one, however this one ends.

    Args:
        signatures: of the kernels.
        progress: called with the number of kernels done since the last call.

    Returns:
        Kernels that could not be: they are compiled where they are called.
    """
    cores, unrelated = len(os.sched_getaffinity(0)), set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    try:
        with ProcessPoolExecutor(min(cores, len(signatures)), context, _end_with_parent) as pool:
            tasks = {pool.submit(_compile, name, found): name for name, found in signatures.items()}
            try:
                for _ in as_completed(tasks):
                    progress(1)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in set(multiprocessing.active_children()) - unrelated:
                    process.kill()
                raise
    except BrokenProcessPool:
        return list(signatures)
    return [name for task, name in tasks.items() if task.exception() is not None]


def described(kind: Any) -> Any:
    """A type of an argument as JSON has it: numbers by numpy's letter, arrays with dimensions,
    layout and `r` if they are read only, tuples as lists, named ones under their class.
    """
    if isinstance(kind, types.BaseNamedTuple):
        named: Any = kind
        owner = named.instance_class
        return {f"{owner.__module__}:{owner.__qualname__}": _parts(kind)}
    if isinstance(kind, types.BaseTuple):
        return _parts(kind)
    if isinstance(kind, types.Array):
        closed = "" if kind.mutable else "r"
        return f"{as_dtype(kind.dtype).char}{kind.ndim}{kind.layout}{closed}"
    return as_dtype(kind).char


def _parts(kind: Any) -> list[Any]:
    return [described(part) for part in kind]


def meant(description: Any) -> Any:
    """The type that :func:`described` describes."""
    if isinstance(description, dict):
        ((owner, parts),) = description.items()
        return _tuple_of([meant(part) for part in parts], _found(owner))
    if isinstance(description, list):
        return _tuple_of([meant(part) for part in description])
    number = from_dtype(np.dtype(description[0]))
    if len(description) == 1:
        return number
    dimensions, layout = int(description[1]), description[2]
    return types.Array(number, dimensions, layout, readonly=description.endswith("r"))


def _found(name: str) -> Any:
    module, attribute = name.split(":")
    return getattr(importlib.import_module(module), attribute)


def _end_with_parent() -> None:
    """In a process that compiles: its parent alone is interrupted, and none outlives it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _compile(name: str, signatures: list[Any]) -> None:
    """In a process of its own; what is in the cache already is only read."""
    kernel = _found(name)
    for signature in signatures:
        kernel.compile(tuple(meant(part) for part in signature))
