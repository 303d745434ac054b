"""The same nearest point by OSQP, which shares nothing with :mod:`planner.profile.banded_nearest`.

A first-order method: slow where constraints are active over many stations, but it has no factors
that could break down. It is asked where the interior-point method fails.
"""

from __future__ import annotations

import numpy as np
import osqp
from scipy import sparse

from models.arrays import Bools, Floats, Ints

_TOLERANCE = 1e-4
_ITERATIONS = 4000
"""In which it gets there nineteen times out of twenty; that nothing is feasible takes it 250."""


def nearest_by_osqp(
    wanted: Floats, fixed: Bools, start: Ints, rows: Floats, limit: Floats, x: Floats,
    force: Floats,
) -> int:  # fmt: skip
    """As :func:`planner.profile.banded_nearest.nearest`; constraints are kept within 1e-4."""
    n, r = len(wanted), len(limit)
    a = matrix_of(start, rows)
    # What is fixed moves to the right.
    right = limit - a @ np.where(fixed, wanted, 0.0)
    a = a @ sparse.diags(np.where(fixed, 0.0, 1.0))
    solver = osqp.OSQP()
    solver.setup(
        sparse.eye(n, format="csc"), -wanted, a.tocsc(), np.full(r, -np.inf), right, verbose=False,
        eps_abs=_TOLERANCE, eps_rel=0.0, max_iter=_ITERATIONS, polishing=False,
        scaling=0, rho=1.0,
    )  # fmt: skip
    result = solver.solve(raise_error=False)
    used = max(int(result.info.iter), 1)
    if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
        return -used
    x[:], force[:] = np.where(fixed, wanted, result.x), np.maximum(result.y, 0.0)
    return used


def matrix_of(start: Ints, rows: Floats) -> sparse.csr_matrix:
    """(R, N) matrix of rows over three neighbours, for solvers that know no such rows."""
    n, r = len(start) + 1, len(rows)
    columns = np.repeat(np.arange(n - 2), np.diff(start))[:, None] + np.arange(3)
    return sparse.csr_matrix((rows.ravel(), columns.ravel(), 3 * np.arange(r + 1)), shape=(r, n))
