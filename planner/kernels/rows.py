"""One row of numbers into another, as a pass of its own.

`out[:] = row` makes numba compile all that a mismatch of shapes could need, words of the error
included: seconds for each kernel that has it.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from slopewise.planner.kernels.compiled import row_pass


@row_pass
def copy_row(row: NDArray[Any], out: NDArray[Any]) -> None:
    """Copy (M,) numbers of any kind."""
    for j in range(out.shape[0]):
        out[j] = row[j]
