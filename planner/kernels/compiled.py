"""One place for how the hot path is compiled.

Kernels see float64 scalars and arrays only and release the GIL; they run on one thread, because a
second one costs milliseconds on a busy machine. Compiled code is cached on disk beside the source,
so that only the first run after an installation or a change of the source pays for the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from numba.core import config

from slopewise.planner.kernels.borrowing import Borrowing
from slopewise.planner.kernels.interpreted import Kernel
from slopewise.planner.kernels.stale import forget_stale_kernels

forget_stale_kernels(Path(__file__).parents[1], Path(__file__).parents[2] / "models")

P = ParamSpec("P")
R = TypeVar("R")

_COMPILED: dict[str, Any] = {
    "nopython": True,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "boundscheck": None,
}

_NUMBA: Any = config

TILE = 64
"""Candidates worked on together: a tile of rows stays in the first-level cache."""


@cache
def _borrowing(function: Callable[..., Any]) -> Borrowing:
    """A law that many kernels call is compiled once for all."""
    return Borrowing(function)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function for float64 scalars and arrays; NaN keeps its meaning."""
    if _NUMBA.DISABLE_JIT:
        return function
    compiled: Any = Kernel(function, targetoptions=_COMPILED)
    compiled.enable_caching()
    return cast(Callable[P, R], compiled)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function, or a law of `models`, so that a kernel can call it at no cost.

    It borrows its arrays and does not count references to them, which would cost more than many a
    function's work. So it allocates nothing, and returns arrays to its like only, never to a
    kernel.
    """
    return cast(Callable[P, R], _borrowing(function))


def row_pass(function: Callable[P, R]) -> Callable[P, R]:
    """Compile one pass along a row, a lane for each candidate, to run on many lanes at once.

    It borrows its arrays, as what is :func:`inlined` does. To run on many lanes its loop has no
    branch, reads all it needs before it chooses, and takes rows as they lie in memory:
    `a = rows[0]`, where `a, b = rows` would give strided ones; rows of one array that it reads and
    writes are handed to it, not taken inside. A product and its sum are one instruction with one
    rounding; NaN keeps its meaning.
    """
    return cast(Callable[P, R], Borrowing(function, fastmath={"contract"}))
