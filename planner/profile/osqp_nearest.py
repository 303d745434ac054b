"""The same nearest point by OSQP, which shares nothing with
:mod:`slopewise.planner.profile.banded_nearest`.

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
"""In which it gets there nineteen times out of twenty; that nothing is feasible takes it 250."""


def nearest_by_osqp(
    wanted: Floats, fixed: Bools, rows: Floats, limit: Floats, x: Floats, force: Floats
) -> int:
    """As :func:`slopewise.planner.profile.banded_nearest.nearest`; constraints are kept within
    1e-4.
    """
    n = len(wanted)
    a, right = matrix_of(rows), limit.ravel()
    # What is fixed moves to the right.
    right = right - a @ np.where(fixed, wanted, 0.0)
    a = a @ sparse.diags(np.where(fixed, 0.0, 1.0))
    solver = osqp.OSQP()
    solver.setup(
        sparse.eye(n, format="csc"),
        -wanted,
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
    if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
        return -used
    x[:] = np.where(fixed, wanted, result.x)
    force[:] = np.maximum(result.y, 0.0).reshape(force.shape)
    return used


def matrix_of(rows: Floats) -> sparse.csr_matrix:
    """(K N, N) matrix of (K, 3, N) rows over three neighbours, for solvers that know no such."""
    kinds, _, n = rows.shape
    size, row = (kinds * n, n), np.arange(kinds * n)
    values = rows.transpose(1, 0, 2).reshape(3, -1)
    columns = [np.minimum(row % n + i, n - 1) for i in range(3)]
    parts = [sparse.csr_matrix((v, (row, c)), size) for v, c in zip(values, columns, strict=True)]
    return sparse.csr_matrix(parts[0] + parts[1] + parts[2])
