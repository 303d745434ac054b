"""What the smoothing needs of CasADi: the time between segments with its derivatives, and a solver
that is exact where OSQP gives up.

The time is convex in v², so a tangent never overestimates it: a limit written with the tangent is
on the safe side wherever the solution goes, and exact where it touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from planner.compiled import Floats

SLOWEST = 0.15
"""Tangents are taken at this speed or above [m/s]; below it they would be vertical."""

_MOST_ITERATIONS = 60
"""Of the interior-point method; most programs need fifteen, the hardest fifty."""


@dataclass(frozen=True, slots=True)
class TimeModel:
    """Mid-to-mid times around a profile of N stations.

    Attributes:
        between: (N − 2,) time from the middle of one segment to that of the next [s].
        between_gradient: (3, N − 2) its derivative over v² of the three stations [s³/m²].
    """

    between: Floats
    between_gradient: Floats


@lru_cache(maxsize=16)
def _between(stations: int) -> Any:
    row = stations - 2
    a, b, c = (ca.SX.sym(name, 1, row) for name in "abc")
    before, after = ca.SX.sym("ds_before", 1, row), ca.SX.sym("ds_after", 1, row)
    time = before / (ca.sqrt(a) + ca.sqrt(b)) + after / (ca.sqrt(b) + ca.sqrt(c))
    # Each time depends on its own three stations only: one gradient of their sum holds all.
    gradients = [ca.gradient(ca.sum2(time), v) for v in (a, b, c)]
    return ca.Function("between", [a, b, c, before, after], [time, *gradients])


class MidTimes:
    """The mid-to-mid times of profiles of N stations, evaluated in place; one for each thread."""

    def __init__(self, stations: int) -> None:
        row = stations - 2
        self._inputs = np.zeros((5, row))
        self._value, self._gradient = np.zeros(row), np.zeros((3, row))
        self._buffer, self._evaluate = _between(stations).buffer()
        for i, values in enumerate(self._inputs):
            self._buffer.set_arg(i, values.data)
        for i, values in enumerate((self._value, *self._gradient)):
            self._buffer.set_res(i, values.data)

    def around(self, speed_sq: Floats, ds: Floats) -> TimeModel:
        """Linearise around a profile; the arrays hold until the next call.

        Args:
            speed_sq: (N,) v² at the stations [m²/s²].
            ds: (N − 1,) segment lengths [m].
        """
        stations = len(speed_sq)
        y = np.maximum(speed_sq, SLOWEST**2)
        for i in range(3):
            self._inputs[i] = y[i : stations - 2 + i]
        self._inputs[3], self._inputs[4] = ds[:-1], ds[1:]
        self._evaluate()
        # Where the profile is slower than the tangent's point, carry the tangent back to it.
        carried = speed_sq - y
        for i in range(3):
            self._value += self._gradient[i] * carried[i : stations - 2 + i]
        return TimeModel(self._value, self._gradient)


def time_model(speed_sq: Floats, ds: Floats) -> TimeModel:
    """As :meth:`MidTimes.around`, in arrays of its own."""
    return MidTimes(len(speed_sq)).around(speed_sq, ds)


@lru_cache(maxsize=16)
def _exact_solver(sparsity: tuple[int, int, tuple[int, ...], tuple[int, ...]]) -> Any:
    rows, columns, starts, indices = sparsity
    shape = ca.Sparsity(rows, columns, list(starts), list(indices))
    pattern: dict[str, Any] = {"h": ca.Sparsity.diag(columns), "a": shape}
    options: dict[str, Any] = {"error_on_fail": False, "piqp": {"max_iter": _MOST_ITERATIONS}}
    return ca.conic("exact", "piqp", pattern, options)


def nearest_exactly(
    constraints: sparse.csc_matrix, lower: Floats, upper: Floats, wanted: Floats
) -> tuple[Floats, Floats] | None:
    """The point nearest to another under linear constraints, by an interior-point method.

    Args:
        constraints: (rows, N) matrix A; lower, upper: (rows,) limits of A x, all finite.
        wanted: (N,) the other point.

    Returns:
        (N,) x and the (rows,) multipliers of A x, as OSQP signs them; None if there is no such x.
        Slower than a warm OSQP, but never in doubt.
    """
    a = constraints
    rows, columns = a.shape
    solver = _exact_solver((rows, columns, tuple(a.indptr.tolist()), tuple(a.indices.tolist())))
    result = solver(
        h=ca.DM.eye(columns),
        a=ca.DM(solver.sparsity_in("a"), a.data),
        g=-wanted,
        lba=lower,
        uba=upper,
    )
    if not solver.stats()["success"]:
        return None
    return np.asarray(result["x"]).ravel(), np.asarray(result["lam_a"]).ravel()
