"""The types of arrays, and of what laws take and give.

Shapes and units stand in the docstrings of what takes and gives them.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Singles: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Bytes: TypeAlias = NDArray[np.uint8]

Elementwise: TypeAlias = Any
"""A float, an ndarray or a scalar casadi symbol alike.

A law with such arguments works entry by entry and keeps no state. Arrays broadcast against each
other by numpy's rules: stations (N,), batches of candidates (N, M), vehicle constants as floats.
The result is a float, an array or a symbol as the arguments are. To keep it so, a law uses
arithmetic and numpy's elementwise functions (``sqrt``, ``cos``, ``fmax``, …) only, never a branch
on a value, ``where``, ``clip`` or ``maximum``, and calls no other law: then casadi can
differentiate it as it stands, and the core is written from what it records.

Outside its domain a law gives NaN, never a plausible number. ``fmax`` and ``fmin``
drop a NaN, and a quotient or a square hides a wrong sign, so a law multiplies by one of these,
which are 1 within the domain and change no digit of it:

- ``np.sqrt(np.sign(x))``: NaN where x < 0 or x is NaN, 0 where x = 0;
- ``np.sqrt(np.sign(x + 1e-300))``: the same, but 1 where x = 0;
- ``np.sign(1.0 + np.fabs(x))``: NaN where x is NaN.

Constants of a vehicle are checked where a model file is read, and not again in a law.
"""


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """The same array, closed for writing: value objects share it without fear."""
    array.flags.writeable = False
    return array
