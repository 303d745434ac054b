"""The point nearest to another under constraints that reach over three neighbours at most.

A primal-dual interior-point method with Mehrotra's corrector. What makes it quick is that its
linear system has two diagonals beside the main one, so that an iteration costs a few passes along
the stations; rows lie by kinds, so that all but the factors are worked on for many stations at
once. It needs no start and fails only where no point keeps the constraints; general solvers for
quadratic programs take several times as long for the same problem.

Source: S. Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2,
1992; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., algorithm 16.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass
from slopewise.planner.kernels.rows import copy_row

_ITERATIONS = 60
"""Iterations at most [1]; eleven are typical, and a program that takes 60 does not converge."""
_TOLERANCE = 1e-5
"""Of constraints and of optimality, in their own units."""

_STEP = 0.995
"""Share of the way to the border that a step may go."""

_LEAST = 1e-12
"""Smallest slack and multiplier [scaled]: keeps their quotients finite."""
_CENTRED = 0.01
"""Share of the tolerance up to which slack times force of each row may differ from none."""

_LOST = 1e12
"""Residual from which the iteration has diverged [scaled]."""


class _Program(NamedTuple):
    """What is asked, see :func:`nearest`; `open`: (N,) 0 where x is fixed, else 1."""

    wanted: Floats
    open: Floats
    rows: Floats


class _Rows(NamedTuple):
    """Of each row, (K, N), or (K N,) one kind behind the other: its limit, and where it is.

    Attributes:
        ds, dz: steps of slack and force. along: the row times point or step.
    """

    limit: Floats
    slack: Floats
    force: Floats
    over_slack: Floats
    over_force: Floats
    breach: Floats
    ds: Floats
    dz: Floats
    along: Floats


class _Iterate(NamedTuple):
    """Where the iterations are.

    Attributes:
        x, step: (N + 2,) point and step, two zeros behind them.
        pull: (N,) sum of the rows by their force.
        band: (3, N) the factored matrix.
        each, flat: the rows, by kinds and one kind behind the other: the same memory.
        sums: (6, N) room for what is summed over rows.
    """

    x: Floats
    step: Floats
    pull: Floats
    band: Floats
    each: _Rows
    flat: _Rows
    sums: Floats


@kernel
def nearest(
    wanted: Floats, fixed: Bools, rows: Floats, limit: Floats, x: Floats, force: Floats
) -> int:
    """Minimise |x − wanted|² / 2 over rows · x <= limit.

    Args:
        wanted: (N,) the other point, N >= 3.
        fixed: (N,) where x is as wanted.
        rows: (K, 3, N) coefficients of x[k], x[k + 1] and x[k + 2] in K rows for each k; 0 behind
            the last station, and in all of a row that there is not, whose limit is positive.
        limit: (K, N) upper limits.
        x: (N,) out, the answer.
        force: (K, N) out, the multipliers of the rows, >= 0.

    Returns:
        Iterations, at least one; negative if no point keeps the constraints.
    """
    kinds, n = limit.shape
    copy_row(wanted, x)
    if kinds == 0:
        return 1
    is_open, few, flat = np.empty(n), np.empty((10, n)), np.zeros((7, kinds * n))
    many = flat.reshape((7, kinds, n))
    points = np.zeros((2, n + 2))
    for k in range(n):
        is_open[k] = 0.0 if fixed[k] else 1.0
        points[0, k] = wanted[k]
    p = _Program(wanted, is_open, rows)
    each = _Rows(limit, many[0], force, many[1], many[2], many[3], many[4], many[5], many[6])
    by_kind = _Rows(
        limit.reshape(kinds * n),
        flat[0],
        force.reshape(kinds * n),
        flat[1],
        flat[2],
        flat[3],
        flat[4],
        flat[5],
        flat[6],
    )
    s = _Iterate(points[0], points[1], few[6], few[7:], each, by_kind, few[:6])
    _along(p, s.x, s.each.along)
    _begin(s.flat.limit, s.flat.along, s.flat.slack, s.flat.force)
    used = -_ITERATIONS
    for iteration in range(_ITERATIONS):
        gap, worst, still = _residuals(p, s)
        if worst <= _TOLERANCE and still <= _TOLERANCE and gap <= _CENTRED * _TOLERANCE:
            used = iteration + 1
            break
        if not (worst + still + gap < _LOST):
            return -iteration - 1
        _matrix(p, s)
        if not _factor(s.band[0], s.band[1], s.band[2]):
            return -iteration - 1
        share = _move(p, s, 0.0, 0.0)
        after = _after(s, share)
        centre = (after / gap) ** 3 * gap
        share = _move(p, s, centre, 1.0)
        _go(s.step, share, s.x)
        _go_inside(s.flat.ds, share, s.flat.slack)
        _go_inside(s.flat.dz, share, s.flat.force)
    for k in range(n):
        x[k] = s.x[k]
    return used


@kernel
def room(rows: Floats, limit: Floats, force: Floats, x: Floats) -> float:
    """Sum of force times what is left to the limit, where that is positive.

    Arguments as of :func:`nearest`: rows (K, 3, N), limit and force (K, N), x (N,).
    """
    n, total = x.shape[0], 0.0
    for m in range(limit.shape[0]):
        for k in range(n):
            along = 0.0
            for i in range(min(3, n - k)):
                along += rows[m, i, k] * x[k + i]
            total += force[m, k] * max(limit[m, k] - along, 0.0)
    return total


@kernel
def keeps_none(most: Floats, fixed: Bools, rows: Floats, limit: Floats, force: Floats) -> bool:
    """Do multipliers prove that no point from 0 to ``most`` keeps the rows?

    A sum of the rows, each times its force, is below the sum of their limits at every point that
    keeps them. Where it is above it even at the lowest point of the box, there is none: Farkas'
    lemma, which holds for forces of any origin. An iteration that diverges leads to such forces.

    Args:
        most: (N,) highest x, that of stations which are fixed. fixed, rows, limit: as of
            :func:`nearest`. force: (K, N) multipliers, >= 0.
    """
    kinds, n = limit.shape
    pull = np.empty(n)
    _pull(rows, force, np.empty((3, n)), pull)
    least, highest, size = 0.0, 0.0, 0.0
    for k in range(n):
        for m in range(kinds):
            highest += force[m, k] * limit[m, k]
        moved = pull[k] * most[k]
        size += abs(moved)
        least += moved if fixed[k] else min(moved, 0.0)
    return bool(least - highest > _TOLERANCE * (size + abs(highest)))


@row_pass
def _begin(limit: Floats, along: Floats, slack: Floats, force: Floats) -> None:
    for k in range(limit.shape[0]):
        slack[k] = max(limit[k] - along[k], 1.0)
        force[k] = 1.0


@inlined
def _along(p: _Program, x: Floats, out: Floats) -> None:
    """Rows times a point, which has two zeros behind it."""
    kinds, n = out.shape
    for m in range(kinds):
        _times(p.rows[m, 0], p.rows[m, 1], p.rows[m, 2], x[:n], x[1 : n + 1], x[2 : n + 2], out[m])


@row_pass
def _times(
    a: Floats, b: Floats, c: Floats, x: Floats, next_x: Floats, last_x: Floats, out: Floats
) -> None:
    for k in range(out.shape[0]):
        out[k] = a[k] * x[k] + b[k] * next_x[k] + c[k] * last_x[k]


@inlined
def _residuals(p: _Program, s: _Iterate) -> tuple[float, float, float]:
    """Mean of slack times force, largest breach of a row, and largest pull left at a station."""
    kinds, n = s.each.slack.shape
    _along(p, s.x, s.each.along)
    _clear(s.sums[0])
    _clear(s.sums[1])
    flat = s.flat
    _breach(flat.along, flat.slack, flat.limit, flat.breach)
    _inverse(flat.slack, flat.over_slack)
    _inverse(flat.force, flat.over_force)
    for m in range(kinds):
        _add_product(s.each.slack[m], s.each.force[m], s.sums[0])
        _keep_largest(s.each.breach[m], s.sums[1])
    gap, worst, still, total = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        gap += s.sums[0, k]
        worst = max(worst, s.sums[1, k])
    _pull(p.rows, s.each.force, s.sums, s.pull)
    for k in range(n):
        left = p.open[k] * (p.wanted[k] - s.x[k] - s.pull[k])
        still = max(still, abs(left))
        # NaN is in a sum what it is not in a maximum.
        total += left
    return gap / (kinds * n) + 0.0 * total, worst, still


@row_pass
def _clear(row: Floats) -> None:
    for k in range(row.shape[0]):
        row[k] = 0.0


@row_pass
def _breach(along: Floats, slack: Floats, limit: Floats, out: Floats) -> None:
    for k in range(out.shape[0]):
        out[k] = along[k] + slack[k] - limit[k]


@row_pass
def _inverse(row: Floats, out: Floats) -> None:
    for k in range(row.shape[0]):
        out[k] = 1.0 / row[k]


@row_pass
def _add_product(row: Floats, other: Floats, total: Floats) -> None:
    for k in range(row.shape[0]):
        total[k] += row[k] * other[k]


@row_pass
def _keep_largest(row: Floats, largest: Floats) -> None:
    for k in range(row.shape[0]):
        size, most = abs(row[k]), largest[k]
        largest[k] = (size if size > most else most) + 0.0


@inlined
def _after(s: _Iterate, share: float) -> float:
    """Mean of slack times force after a share of the steps."""
    (kinds, n), each = s.each.slack.shape, s.each
    total = s.sums[0]
    _clear(total)
    for m in range(kinds):
        _add_product_after(each.slack[m], each.ds[m], each.force[m], each.dz[m], share, total)
    after = 0.0
    for k in range(n):
        after += total[k]
    return float(after / (kinds * n))


@row_pass
def _add_product_after(
    slack: Floats, ds: Floats, force: Floats, dz: Floats, share: float, total: Floats
) -> None:
    for k in range(slack.shape[0]):
        total[k] += (slack[k] + share * ds[k]) * (force[k] + share * dz[k])


@row_pass
def _go(step: Floats, share: float, x: Floats) -> None:
    for k in range(x.shape[0]):
        x[k] += share * step[k]


@row_pass
def _go_inside(step: Floats, share: float, value: Floats) -> None:
    for k in range(value.shape[0]):
        gone = value[k] + share * step[k]
        value[k] = gone if gone > _LEAST else _LEAST


@inlined
def _move(p: _Program, s: _Iterate, centre: float, corrects: float) -> float:
    """Newton's step towards a centre, and the share of it that may be gone."""
    (kinds, n), flat = s.each.slack.shape, s.flat
    _force_without_step(flat, centre, corrects)
    _pull(p.rows, s.each.dz, s.sums, s.pull)
    _wanted_step(p.wanted, p.open, s.x[:n], s.pull, s.step[:n])
    _solve(s.band[0], s.band[1], s.band[2], s.step[:n])
    _along(p, s.step, s.each.along)
    longest = s.sums[0]
    _clear(longest)
    _steps(flat.along, flat.breach, flat.force, flat.over_slack, flat.ds, flat.dz)
    for m in range(kinds):
        _keep_largest_share(s.each.ds[m], s.each.over_slack[m], longest)
        _keep_largest_share(s.each.dz[m], s.each.over_force[m], longest)
    most = _STEP
    for k in range(n):
        most = max(most, longest[k])
    return _STEP / most


@row_pass
def _force_without_step(flat: _Rows, centre: float, corrects: float) -> None:
    slack, force, over_slack = flat.slack, flat.force, flat.over_slack
    breach, ds, dz = flat.breach, flat.ds, flat.dz
    for k in range(slack.shape[0]):
        product = slack[k] * force[k] - centre + corrects * ds[k] * dz[k]
        dz[k] = force[k] + (force[k] * breach[k] - product) * over_slack[k]


@row_pass
def _wanted_step(wanted: Floats, is_open: Floats, x: Floats, pull: Floats, out: Floats) -> None:
    for k in range(out.shape[0]):
        out[k] = is_open[k] * (wanted[k] - x[k] - pull[k])


@row_pass
def _steps(
    along: Floats, breach: Floats, force: Floats, over_slack: Floats, ds: Floats, dz: Floats
) -> None:
    for k in range(along.shape[0]):
        ds[k] = -breach[k] - along[k]
        dz[k] += force[k] * (over_slack[k] * along[k] - 1.0)


@row_pass
def _keep_largest_share(step: Floats, over: Floats, largest: Floats) -> None:
    for k in range(step.shape[0]):
        share, most = -step[k] * over[k], largest[k]
        largest[k] = (share if share > most else most) + 0.0


@inlined
def _pull(rows: Floats, weight: Floats, sums: Floats, out: Floats) -> None:
    """Sum of the rows, each by its weight."""
    n = out.shape[0]
    for i in range(3):
        _clear(sums[i])
        for m in range(weight.shape[0]):
            _add_product(rows[m, i], weight[m], sums[i])
    copy_row(sums[0], out)
    _add(sums[1][: n - 1], out[1:])
    _add(sums[2][: n - 2], out[2:])


@row_pass
def _add(row: Floats, total: Floats) -> None:
    for k in range(row.shape[0]):
        total[k] += row[k]


@inlined
def _matrix(p: _Program, s: _Iterate) -> None:
    """1 + Σ force / slack · rowᵀ row, without stations that are fixed; band[m, k] is element
    (k, k + m).
    """
    kinds, n = s.each.slack.shape
    for i in range(6):
        _clear(s.sums[i])
    aa, ab, ac, bb, bc, cc = s.sums[0], s.sums[1], s.sums[2], s.sums[3], s.sums[4], s.sums[5]
    _product(s.flat.force, s.flat.over_slack, s.flat.along)
    for m in range(kinds):
        a, b, c, weight = p.rows[m, 0], p.rows[m, 1], p.rows[m, 2], s.each.along[m]
        _add_products(weight, a, a, b, aa, ab)
        _add_products(weight, c, c, a, cc, ac)
        _add_products(weight, b, b, c, bb, bc)
    d, e, f = s.band[0], s.band[1], s.band[2]
    copy_row(aa, d)
    _add(bb[: n - 1], d[1:])
    _add(cc[: n - 2], d[2:])
    copy_row(ab, e)
    _add(bc[: n - 1], e[1:])
    copy_row(ac, f)
    for k in range(n):
        d[k] = 1.0 + p.open[k] * d[k]
        e[k] = e[k] * p.open[k] * p.open[k + 1] if k + 1 < n else 0.0
        f[k] = f[k] * p.open[k] * p.open[k + 2] if k + 2 < n else 0.0


@row_pass
def _product(row: Floats, other: Floats, out: Floats) -> None:
    for k in range(row.shape[0]):
        out[k] = row[k] * other[k]


@row_pass
def _add_products(
    weight: Floats, row: Floats, by: Floats, other: Floats, total: Floats, total_2: Floats
) -> None:
    """Weight times row times two others."""
    for k in range(weight.shape[0]):
        weighed, more, more_2 = weight[k] * row[k], total[k], total_2[k]
        total[k] = more + weighed * by[k]
        total_2[k] = more_2 + weighed * other[k]


@inlined
def _factor(d: Floats, e: Floats, f: Floats) -> bool:
    """Replace a banded matrix by its factors L D Lᵀ: 1/D in the first row, L in the others."""
    n = d.shape[0]
    now, later, last, beside = d[0], d[1], d[2], e[0]
    for k in range(n):
        if not now > 0.0:
            return False
        over = 1.0 / now
        part, part_2 = beside * over, f[k] * over
        d[k] = over
        now = later - beside * part
        later = last - f[k] * part_2
        last = d[k + 3] if k + 3 < n else 1.0
        beside, e[k], f[k] = (e[k + 1] if k + 1 < n else 0.0) - beside * part_2, part, part_2
    return True


@inlined
def _solve(d: Floats, e: Floats, f: Floats, x: Floats) -> None:
    """Replace x by what the factored matrix maps to it."""
    n = x.shape[0]
    before, before_2 = 0.0, 0.0
    for k in range(n):
        now = x[k] - before
        x[k] = now
        before, before_2 = before_2 + e[k] * now, f[k] * now
    after, after_2 = 0.0, 0.0
    for k in range(n - 1, -1, -1):
        now = x[k] * d[k] - e[k] * after - f[k] * after_2
        x[k], after, after_2 = now, now, after
