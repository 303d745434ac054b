"""The nearest point by OSQP, which shares nothing with `planner/core/profile/nearest_point.hpp`.

A first-order method: slow where constraints are active over many stations, but it has no factors
that could break down. It is asked where the interior-point method fails.
"""

from __future__ import annotations

import numpy as np
import osqp
from scipy import sparse

from slopewise.models.arrays import Bools, Floats

_TOLERANCE = 1e-4
"""Absolute and relative tolerance of OSQP [scaled]: below the tightening of the constraints."""
_ITERATIONS = 4000
"""In which it gets there in 19 of 20 cases; that nothing is feasible takes it 250."""


def nearest_by_osqp(
    target: Floats, fixed: Bools, rows: Floats, limit: Floats
) -> tuple[int, Floats]:
    """Minimise |x − target|² / 2 over rows · x <= limit, which is kept within 1e-4.

    Args:
        target: (N,) the other point, N >= 3.
        fixed: (N,) where x is as target.
        rows: (K, 3, N) coefficients of x[k], x[k + 1] and x[k + 2] in K rows for each k; 0 behind
            the last station, and in all of a row that there is not, whose limit is positive.
        limit: (K, N) upper limits.

    Returns:
        Iterations, at least one; negative if no point keeps the constraints. The point, (N,).
    """
    n = len(target)
    a, right = matrix_of(rows), limit.ravel()
    # What is fixed moves to the right.
    right = right - a @ np.where(fixed, target, 0.0)
    a = a @ sparse.diags(np.where(fixed, 0.0, 1.0))
    solver = osqp.OSQP()
    solver.setup(
        sparse.eye(n, format="csc"),
        -target,
        a.tocsc(),
        np.full(len(right), -np.inf),
        right,
        verbose=False,
        eps_abs=_TOLERANCE,
        eps_rel=0.0,
        max_iter=_ITERATIONS,
        polishing=False,
        scaling=0,
        rho=1.0,
    )
    result = solver.solve(raise_error=False)
    used = max(int(result.info.iter), 1)
    is_solved = result.info.status_val == osqp.SolverStatus.OSQP_SOLVED
    return used if is_solved else -used, np.where(fixed, target, result.x)


def matrix_of(rows: Floats) -> sparse.csr_matrix:
    """(K N, N) matrix of (K, 3, N) rows over three neighbours, for solvers that know no such."""
    kinds, _, n = rows.shape
    size, row = (kinds * n, n), np.arange(kinds * n)
    values = rows.transpose(1, 0, 2).reshape(3, -1)
    columns = [np.minimum(row % n + i, n - 1) for i in range(3)]
    parts = [sparse.csr_matrix((v, (row, c)), size) for v, c in zip(values, columns, strict=True)]
    return sparse.csr_matrix(parts[0] + parts[1] + parts[2])
