"""Kernels as the Python that they are: what a first plan does while the compiler is still at work.

A kernel takes seconds to compile and, in Python, milliseconds for a path. So a plan of a few paths
is there long before the compiler is done. It is the same source, and what comes out is judged as
ever; only the rounding of single products differs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher

from slopewise.planner.kernels.borrowing import Borrowing


class Kernel(CPUDispatcher):
    """What Python calls of the hot path."""


_python = False
_compiled = Borrowing.__call__


def is_interpreting() -> bool:
    """Kernels run as Python now: whoever can do with fewer passes had better."""
    return _python


def interpret(yes: bool) -> None:
    """From now on kernels run as Python in this process, or compiled again.

    As Python they may raise ArithmeticError or ValueError where compiled ones have NaN.
    """
    global _python
    if yes == _python:
        return
    _python = yes
    kernel: Any = Kernel
    borrowing: Any = Borrowing
    if yes:
        kernel.__call__, borrowing.__call__ = _kernel_in_python, _in_python
    else:
        # Compiled ones cost nothing more to call: numba itself does it again.
        del kernel.__call__
        borrowing.__call__ = _compiled


def _kernel_in_python(function: CPUDispatcher, *args: Any) -> Any:
    # As compiled code it warns of nothing; numpy's state is that of the calling thread.
    with np.errstate(all="ignore"):
        return function.py_func(*args)


def _in_python(function: CPUDispatcher, *args: Any) -> Any:
    return function.py_func(*args)
