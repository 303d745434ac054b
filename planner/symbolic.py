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
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    before, after = ca.SX.sym("ds_before"), ca.SX.sym("ds_after")
    time = before / (ca.sqrt(a) + ca.sqrt(b)) + after / (ca.sqrt(b) + ca.sqrt(c))
    gradient = ca.gradient(time, ca.vertcat(a, b, c))
    return ca.Function("between", [a, b, c, before, after], [time, gradient]).map(stations - 2)


def time_model(speed_sq: Floats, ds: Floats) -> TimeModel:
    """Linearise the mid-to-mid times around a profile.

    Args:
        speed_sq: (N,) v² at the stations [m²/s²].
        ds: (N − 1,) segment lengths [m].
    """
    stations = len(speed_sq)
    y = np.maximum(speed_sq, SLOWEST**2)
    between, tangent = _between(stations)(y[:-2], y[1:-1], y[2:], ds[:-1], ds[1:])
    tangent = np.asarray(tangent)
    value = np.asarray(between).ravel()
    # Where the profile is slower than the tangent's point, carry the tangent back to it.
    for i in range(3):
        value += tangent[i] * (speed_sq[i : stations - 2 + i] - y[i : stations - 2 + i])
    return TimeModel(value, tangent)


@lru_cache(maxsize=16)
def _exact_solver(sparsity: tuple[int, int, tuple[int, ...], tuple[int, ...]]) -> Any:
    rows, columns, starts, indices = sparsity
    shape = ca.Sparsity(rows, columns, list(starts), list(indices))
    pattern: dict[str, Any] = {"h": ca.Sparsity.diag(columns), "a": shape}
    return ca.conic("exact", "piqp", pattern, {"error_on_fail": False})


def nearest_exactly(
    constraints: sparse.csc_matrix, lower: Floats, upper: Floats, wanted: Floats
) -> Floats | None:
    """The point nearest to another under linear constraints, by an interior-point method.

    Args:
        constraints: (rows, N) matrix A; lower, upper: (rows,) limits of A x, all finite.
        wanted: (N,) the other point.

    Returns:
        (N,) x, None if there is none. Slower than OSQP on easy programs, but never in doubt.
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
    return np.asarray(result["x"]).ravel()
