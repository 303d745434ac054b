"""What kernels call: compiled once for all of them, and without what only Python needs.

For every function numba compiles a second one that takes Python's objects apart and a third for C,
each with the whole function inside, and it compiles a function anew for every constant that it is
called with. A kernel needs none of that.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
from numba.core import types
from numba.core.registry import CPUDispatcher

_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "forceinline": True,
    "_nrt": False,
}

_BARE: dict[str, Any] = {
    "nopython": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""Nothing but what kernels call: it has no entry for Python."""


_plain: Any = types.unliteral


class Borrowing(CPUDispatcher):
    """A function that borrows its arrays from the kernel that calls it.

    Python may call it as well: only then is the part compiled that takes Python's objects.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        """Compile when it is called first."""
        self._options = {**_OPTIONS, **options}
        super().__init__(function, targetoptions={**self._options, **_BARE})

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks where a kernel calls it: a constant is a number like others."""
        plain = tuple(_plain(arg) for arg in args)
        named = {name: _plain(arg) for name, arg in dict(kws).items()}
        return super().get_call_template(plain, named)

    @cached_property
    def _for_python(self) -> Callable[..., Any]:
        compiled: Callable[..., Any] = numba.njit(**self._options)(self.py_func)
        return compiled

    def __call__(self, *args: Any) -> Any:
        """Called from Python."""
        return self._for_python(*args)
