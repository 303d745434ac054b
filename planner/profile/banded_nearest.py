"""The point nearest to another under constraints that reach over three neighbours at most.

A primal-dual interior-point method with Mehrotra's corrector. What makes it quick is that its
linear system has two diagonals beside the main one, so that an iteration costs a few passes along
the stations. It needs no start and fails only where no point keeps the constraints; general solvers
for quadratic programs take several times as long for the same problem.

Source: S. Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2,
1992; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., algorithm 16.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.arrays import Bools, Floats, Ints
from planner.kernels.compiled import inlined, kernel
from planner.kernels.rows import copy_row

_ITERATIONS = 60
_TOLERANCE = 1e-5
"""Of constraints and of optimality, in their own units."""

_STEP = 0.995
"""Share of the way to the border that a step may go."""

_LEAST = 1e-12
_CENTRED = 0.01
"""Share of the tolerance up to which slack times force of each row may differ from none."""

_LOST = 1e12


class _Program(NamedTuple):
    """What is asked: see :func:`nearest`."""

    wanted: Floats
    fixed: Bools
    start: Ints
    rows: Floats


class _Iterate(NamedTuple):
    """Where the iterations are.

    Attributes:
        x, step, pull: (N,) point, step, and sum of the rows by their force.
        band: (N, 3) the factored matrix.
        slack, force, over_slack, over_force, breach: (R,) of each row.
        ds, dz: (R,) steps of slack and force.
    """

    x: Floats
    step: Floats
    band: Floats
    pull: Floats
    slack: Floats
    force: Floats
    over_slack: Floats
    over_force: Floats
    breach: Floats
    ds: Floats
    dz: Floats


@kernel
def nearest(
    wanted: Floats, fixed: Bools, start: Ints, rows: Floats, limit: Floats,
    x: Floats, force: Floats,
) -> int:  # fmt: skip
    """Minimise |x − wanted|² / 2 over rows · x <= limit.

    Args:
        wanted: (N,) the other point, N >= 3.
        fixed: (N,) where x is as wanted.
        start: (N − 1,) rows from start[k] up to start[k + 1] reach x[k], x[k + 1] and x[k + 2].
        rows: (R, 3) coefficients.
        limit: (R,) upper limits.
        x: (N,) out, the answer.
        force: (R,) out, the multipliers of the rows, >= 0.

    Returns:
        Iterations, at least one; negative if no point keeps the constraints.
    """
    n, r = x.shape[0], limit.shape[0]
    copy_row(wanted, x)
    slack, ds, dz, breach = np.empty(r), np.zeros(r), np.zeros(r), np.empty(r)
    # Divisions are what an iteration costs: one for each of these.
    over_slack, over_force = np.empty(r), np.empty(r)
    band, pull, step = np.empty((n, 3)), np.empty(n), np.empty(n)
    if r == 0:
        return 1
    program = _Program(wanted, fixed, start, rows)
    state = _Iterate(x, step, band, pull, slack, force, over_slack, over_force, breach, ds, dz)
    for k in range(n - 2):
        for i in range(start[k], start[k + 1]):
            force[i] = 1.0
            slack[i] = max(limit[i] - _along(rows, x, i, k), 1.0)
    for iteration in range(_ITERATIONS):
        gap, worst, still = _residuals(program, state, limit)
        if worst <= _TOLERANCE and still <= _TOLERANCE and gap <= _CENTRED * _TOLERANCE:
            return iteration + 1
        if not (worst + still + gap < _LOST):
            return -iteration - 1
        _matrix(start, rows, force, over_slack, band)
        _hold(band, fixed)
        if not _factor(band):
            return -iteration - 1
        share = _move(program, state, 0.0, 0.0)
        after = 0.0
        for i in range(r):
            after += (slack[i] + share * ds[i]) * (force[i] + share * dz[i])
        centre = (after / r / gap) ** 3 * gap
        share = _move(program, state, centre, 1.0)
        for k in range(n):
            x[k] += share * step[k]
        for i in range(r):
            slack[i] = max(slack[i] + share * ds[i], _LEAST)
            force[i] = max(force[i] + share * dz[i], _LEAST)
    return -_ITERATIONS


@kernel
def room(start: Ints, rows: Floats, limit: Floats, force: Floats, x: Floats) -> float:
    """Sum of force times what is left to the limit, where that is positive.

    Arguments as of :func:`nearest`: start (N − 1,), rows (R, 3), limit and force (R,), x (N,).
    """
    total = 0.0
    for k in range(x.shape[0] - 2):
        for i in range(start[k], start[k + 1]):
            total += force[i] * max(limit[i] - _along(rows, x, i, k), 0.0)
    return total


@inlined
def _residuals(program: _Program, state: _Iterate, limit: Floats) -> tuple[float, float, float]:
    """Mean of slack times force, largest breach of a row, and largest pull left at a station."""
    start, rows, x = program.start, program.rows, state.x
    slack, force, breach = state.slack, state.force, state.breach
    gap, worst, still = 0.0, 0.0, 0.0
    for k in range(x.shape[0] - 2):
        for i in range(start[k], start[k + 1]):
            gap += slack[i] * force[i]
            breach[i] = _along(rows, x, i, k) + slack[i] - limit[i]
            worst = max(worst, abs(breach[i]))
            state.over_slack[i], state.over_force[i] = 1.0 / slack[i], 1.0 / force[i]
    _pull(start, rows, force, state.pull)
    for k in range(x.shape[0]):
        left = program.wanted[k] - x[k] - state.pull[k]
        still = max(still, 0.0 if program.fixed[k] else abs(left))
    return gap / slack.shape[0], worst, still


@inlined
def _move(program: _Program, state: _Iterate, centre: float, corrects: float) -> float:
    """Newton's step towards a centre, and the share of it that may be gone."""
    n, r = state.step.shape[0], state.slack.shape[0]
    for i in range(r):
        product = state.slack[i] * state.force[i] - centre + corrects * state.ds[i] * state.dz[i]
        state.dz[i] = (
            state.force[i] + (state.force[i] * state.breach[i] - product) * state.over_slack[i]
        )
    _pull(program.start, program.rows, state.dz, state.pull)
    for k in range(n):
        state.step[k] = 0.0 if program.fixed[k] else program.wanted[k] - state.x[k] - state.pull[k]
    _solve(state.band, state.step)
    longest = _STEP
    for k in range(n - 2):
        for i in range(program.start[k], program.start[k + 1]):
            along = _along(program.rows, state.step, i, k)
            state.ds[i] = -state.breach[i] - along
            state.dz[i] += state.force[i] * (state.over_slack[i] * along - 1.0)
            longest = max(
                longest, max(-state.ds[i] * state.over_slack[i], -state.dz[i] * state.over_force[i])
            )
    return _STEP / longest


@inlined
def _along(rows: Floats, x: Floats, i: int, k: int) -> float:
    return float(rows[i, 0] * x[k] + rows[i, 1] * x[k + 1] + rows[i, 2] * x[k + 2])


@inlined
def _pull(start: Ints, rows: Floats, weight: Floats, out: Floats) -> None:
    """Sum of the rows, each by its weight; three running sums move along the stations."""
    n = out.shape[0]
    a, b, c = 0.0, 0.0, 0.0
    for k in range(n - 2):
        for i in range(start[k], start[k + 1]):
            w = weight[i]
            a += w * rows[i, 0]
            b += w * rows[i, 1]
            c += w * rows[i, 2]
        out[k] = a
        a, b, c = b, c, 0.0
    out[n - 2], out[n - 1] = a, b


@inlined
def _matrix(start: Ints, rows: Floats, force: Floats, over_slack: Floats, band: Floats) -> None:
    """1 + Σ force / slack · rowᵀ row; band[k, m] is element (k, k + m)."""
    n = band.shape[0]
    aa, ab, ac, bb, bc, cc = 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    for k in range(n - 2):
        for i in range(start[k], start[k + 1]):
            w = force[i] * over_slack[i]
            a, b, c = rows[i, 0], rows[i, 1], rows[i, 2]
            wa, wb = w * a, w * b
            aa += wa * a
            ab += wa * b
            ac += wa * c
            bb += wb * b
            bc += wb * c
            cc += w * c * c
        band[k, 0], band[k, 1], band[k, 2] = aa, ab, ac
        aa, ab, ac, bb, bc, cc = bb, bc, 0.0, cc, 0.0, 1.0
    band[n - 2, 0], band[n - 2, 1], band[n - 2, 2] = aa, ab, 0.0
    band[n - 1, 0], band[n - 1, 1], band[n - 1, 2] = bb, 0.0, 0.0


@inlined
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


@inlined
def _factor(band: Floats) -> bool:
    """Replace a banded matrix by its factors L D Lᵀ: 1/D in the first column, L in the others."""
    n = band.shape[0]
    for k in range(n):
        d, e, f = band[k, 0], band[k, 1], band[k, 2]
        if not d > 0.0:
            return False
        over = 1.0 / d
        band[k, 0], band[k, 1], band[k, 2] = over, e * over, f * over
        if k + 1 < n:
            band[k + 1, 0] -= e * e * over
            band[k + 1, 1] -= e * f * over
        if k + 2 < n:
            band[k + 2, 0] -= f * f * over
    return True


@inlined
def _solve(band: Floats, x: Floats) -> None:
    """Replace x by what the factored matrix maps to it."""
    n = x.shape[0]
    before, before_2 = 0.0, 0.0
    for k in range(n):
        now = x[k] - before
        x[k] = now
        before, before_2 = before_2 + band[k, 1] * now, band[k, 2] * now
    after, after_2 = 0.0, 0.0
    for k in range(n - 1, -1, -1):
        now = x[k] * band[k, 0] - band[k, 1] * after - band[k, 2] * after_2
        x[k], after, after_2 = now, now, after
