"""Memory for the arrays of a batch, handed out again as soon as nobody holds it.

A process gets fresh memory page by page, each zeroed on its first touch: for the arrays of a
thousand candidates that takes as long as planning them. A block that comes back is warm.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats, Singles

_SMALL = 1 << 17
"""Below this many bytes the allocator of the language keeps memory warm by itself."""

_LINE = 64
"""Arrays begin at the start of a cache line."""

_idle: deque[NDArray[np.uint8]] = deque(maxlen=8)
"""Blocks for the next caller. Each use is one atomic step: threads need no lock."""


class _Loan:
    """The base of all arrays made from a block; when the last of them goes, it gives it back."""

    def __init__(self, block: NDArray[np.uint8], size: int) -> None:
        self._block, self._idle = block, _idle
        start = -block.ctypes.data % _LINE
        self.__array_interface__: Any = block[start : start + size].__array_interface__

    def __del__(self) -> None:
        self._idle.append(self._block)


def empty(*shape: int) -> Floats:
    """An array of floats whose values are whatever was there before."""
    size = 8 * math.prod(shape)
    if size < _SMALL:
        return np.empty(shape)
    array: Floats = np.asarray(_Loan(_block(size), size)).view(np.float64).reshape(shape)
    return array


def empty_singles(*shape: int) -> Singles:
    """As :func:`empty`, of half the precision."""
    count = math.prod(shape)
    array: Singles = empty((count + 1) // 2).view(np.float32)[:count].reshape(shape)
    return array


def _block(size: int) -> NDArray[np.uint8]:
    """An idle block of about this size, or a new one."""
    step = 1 << (size.bit_length() - 3)
    capacity = -(-size // step) * step + _LINE
    others = []
    found = None
    while found is None:
        try:
            block = _idle.pop()
        except IndexError:
            found = np.empty(capacity, np.uint8)
        else:
            if block.size == capacity:
                found = block
            else:
                others.append(block)
    _idle.extend(reversed(others))
    return found
