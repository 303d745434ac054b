"""The point nearest to another under constraints that reach over three neighbours at most.

A primal-dual interior-point method with Mehrotra's corrector. What makes it quick is that its
linear system has two diagonals beside the main one, so that an iteration costs a few passes along
the stations. It needs no start and fails only where no point keeps the constraints; general solvers
for quadratic programs take several times as long for the same problem.

Source: S. Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2,
1992; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., algorithm 16.4.
"""

from __future__ import annotations

import numpy as np

from planner.compiled import Bools, Floats, Ints, inlined, kernel

_ITERATIONS = 60
_STEP = 0.995
"""Share of the way to the border that a step may go."""

_LEAST = 1e-12
_CENTRED = 0.01
"""Share of the tolerance up to which slack times force of each row may differ from none."""


def nearest(
    wanted: Floats,
    fixed: Bools,
    first: Ints,
    rows: Floats,
    limit: Floats,
    *,
    tolerance: float = 1e-6,
) -> Floats | None:
    """Minimise |x − wanted| over rows · x <= limit.

    Args:
        wanted: (N,) the other point, N >= 3.
        fixed: (N,) where x is as wanted.
        first: (R,) first of the three neighbours that a row reaches, <= N − 3.
        rows: (R, 3) coefficients.
        limit: (R,) upper limits, inf for none.
        tolerance: of constraints and of optimality, in their own units.

    Returns:
        (N,) x; None if no point keeps the constraints within the tolerance.
    """
    x = wanted.copy()
    free = np.flatnonzero(np.isfinite(limit))
    solved = _nearest(
        x, wanted, fixed, first[free], np.ascontiguousarray(rows[free]), limit[free], tolerance
    )
    return x if solved else None


@kernel
def _nearest(
    x: Floats, wanted: Floats, fixed: Bools, first: Ints, rows: Floats, limit: Floats,
    tolerance: float,
) -> bool:  # fmt: skip
    n, r = x.shape[0], limit.shape[0]
    slack, force, ds, dz, dzs = (np.ones(r), np.ones(r), np.zeros(r), np.zeros(r), np.zeros(r))
    band, step = np.empty((n, 3)), np.empty(n)
    if r == 0:
        return True
    for i in range(r):
        slack[i] = max(limit[i] - _along(rows, first, x, i), 1.0)
    for _ in range(_ITERATIONS):
        gap, worst = 0.0, 0.0
        step[:] = wanted - x
        band[:, 0], band[:, 1:] = 1.0, 0.0
        for i in range(r):
            gap += slack[i] * force[i]
            dzs[i] = _along(rows, first, x, i) + slack[i] - limit[i]
            worst = max(worst, abs(dzs[i]))
            _add(band, rows, first, i, force[i] / slack[i])
            _pull(step, rows, first, i, -force[i])
        gap /= r
        still = 0.0
        for k in range(n):
            still = max(still, 0.0 if fixed[k] else abs(step[k]))
        if worst <= tolerance and still <= tolerance and gap <= _CENTRED * tolerance:
            return True
        if not (worst + still + gap < 1e12):
            return False
        _hold(band, fixed)
        if not _factor(band):
            return False
        share = _move(
            step, wanted, x, band, fixed, first, rows, slack, force, dzs, 0.0, False, ds, dz
        )
        after = 0.0
        for i in range(r):
            after += (slack[i] + share * ds[i]) * (force[i] + share * dz[i])
        centre = (after / r / gap) ** 3 * gap
        share = _move(
            step, wanted, x, band, fixed, first, rows, slack, force, dzs, centre, True, ds, dz
        )
        for k in range(n):
            x[k] += share * step[k]
        for i in range(r):
            slack[i] = max(slack[i] + share * ds[i], _LEAST)
            force[i] = max(force[i] + share * dz[i], _LEAST)
    return False


@kernel
def _move(
    step: Floats, wanted: Floats, x: Floats, band: Floats, fixed: Bools, first: Ints, rows: Floats,
    slack: Floats, force: Floats, breach: Floats, centre: float, corrects: bool, ds: Floats,
    dz: Floats,
) -> float:  # fmt: skip
    """Newton's step towards a centre, and the share of it that may be gone."""
    n, r = step.shape[0], slack.shape[0]
    step[:] = wanted - x
    for i in range(r):
        product = slack[i] * force[i] - centre
        product += ds[i] * dz[i] if corrects else 0.0
        dz[i] = (force[i] * breach[i] - product) / slack[i]
        _pull(step, rows, first, i, -force[i] - dz[i])
    for k in range(n):
        step[k] = 0.0 if fixed[k] else step[k]
    _solve(band, step)
    share = 1.0
    for i in range(r):
        along = _along(rows, first, step, i)
        ds[i] = -breach[i] - along
        dz[i] += force[i] / slack[i] * along
        share = min(share, -_STEP * slack[i] / ds[i] if ds[i] < 0.0 else 1.0)
        share = min(share, -_STEP * force[i] / dz[i] if dz[i] < 0.0 else 1.0)
    return share


@inlined
def _along(rows: Floats, first: Ints, x: Floats, i: int) -> float:
    k = first[i]
    return float(rows[i, 0] * x[k] + rows[i, 1] * x[k + 1] + rows[i, 2] * x[k + 2])


@inlined
def _pull(out: Floats, rows: Floats, first: Ints, i: int, weight: float) -> None:
    k = first[i]
    out[k] += weight * rows[i, 0]
    out[k + 1] += weight * rows[i, 1]
    out[k + 2] += weight * rows[i, 2]


@inlined
def _add(band: Floats, rows: Floats, first: Ints, i: int, weight: float) -> None:
    """Add the outer product of a row; band[k, m] is element (k, k + m)."""
    k, a, b, c = first[i], rows[i, 0], rows[i, 1], rows[i, 2]
    band[k, 0] += weight * a * a
    band[k, 1] += weight * a * b
    band[k, 2] += weight * a * c
    band[k + 1, 0] += weight * b * b
    band[k + 1, 1] += weight * b * c
    band[k + 2, 0] += weight * c * c


@kernel
def _hold(band: Floats, fixed: Bools) -> None:
    """Fixed stations take no part."""
    n = band.shape[0]
    for k in range(n):
        if fixed[k]:
            band[k, 0], band[k, 1], band[k, 2] = 1.0, 0.0, 0.0
        if k + 1 < n and fixed[k + 1]:
            band[k, 1] = 0.0
        if k + 2 < n and fixed[k + 2]:
            band[k, 2] = 0.0


@kernel
def _factor(band: Floats) -> bool:
    """Replace a banded matrix by its factors L D Lᵀ: D in the first column, L in the others."""
    n = band.shape[0]
    for k in range(n):
        d, e, f = band[k, 0], band[k, 1], band[k, 2]
        if not d > 0.0:
            return False
        band[k, 1], band[k, 2] = e / d, f / d
        if k + 1 < n:
            band[k + 1, 0] -= e * e / d
            band[k + 1, 1] -= e * f / d
        if k + 2 < n:
            band[k + 2, 0] -= f * f / d
    return True


@kernel
def _solve(band: Floats, x: Floats) -> None:
    n = band.shape[0]
    for k in range(n):
        if k + 1 < n:
            x[k + 1] -= band[k, 1] * x[k]
        if k + 2 < n:
            x[k + 2] -= band[k, 2] * x[k]
    for k in range(n - 1, -1, -1):
        x[k] /= band[k, 0]
        if k + 1 < n:
            x[k] -= band[k, 1] * x[k + 1]
        if k + 2 < n:
            x[k] -= band[k, 2] * x[k + 2]
