"""Along which axes, and where on them, a fit still disagrees with its log.

Each axis gets the chi square that shapes along it explain beyond the fit. What chance explains is
found by permuting runs and their signs; p-values are those of the largest of all axes, so that
trying many costs its price.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, gumbel_r

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.prediction import integral
from slopewise.models.discrepancy.search.axes import Axis, axes_of, shapes_of
from slopewise.models.discrepancy.search.refine import Fit, prior_precision, residual
from slopewise.models.discrepancy.thresholds import LEAST_DIRECTION, LOCATED, PERMUTATIONS
from slopewise.models.quantity import GRAVITY

WITHIN = ("speed", "time_since_onset", "brake_heat")
"""Axes that run through each stop; all others tell stops apart."""

_NOT_BY_FRICTION = (*WITHIN, "onset_speed", "grade", "abs_grade")
# What the coefficients themselves act along is told by whole stops only.


@dataclass(frozen=True, slots=True)
class Followed:
    """An axis that a disagreement follows.

    Attributes:
        axis: with its values. chi_square, numbers: explained by its best shapes, and their count.
        strength: −log p of that, before any correction. p_value: corrected for all axes and shapes.
        share: (S, M) of the weight that the best shapes add along each stop.
        removed: mean square of the residual speeds that they take away [m²/s²].
        distance: root mean square of what they add to the stopping distance [m].
    """

    axis: Axis
    chi_square: float
    numbers: int
    strength: float
    p_value: float
    share: Floats
    removed: float
    distance: float


class _Group(NamedTuple):
    """Shapes along one axis that are one hypothesis.

    Attributes:
        axis: its number. member: its place among the groups of shapes of that axis.
        basis: (N, p) or (S, p) orthonormal directions beyond the fit. whole: they count whole stops
            and what happens within, and are (N, p); by frictions alone they are (S, p).
    """

    axis: int
    member: int
    basis: Floats
    whole: bool


def follow(table: StopTable, fit: Fit, seed: int) -> list[Followed]:
    """All axes, the most telling first.

    Args:
        table: stops. fit: what is believed. seed: of the permutations.
    """
    axes = axes_of(table, fit.hypothesis)
    space = _Space(table, fit)
    groups = [g for i, axis in enumerate(axes) for g in space.groups(i, axis)]
    if not groups:  # too few stops to follow anything
        return []
    rows = space.rows(residual(table, fit.hypothesis)[:, :, None])[:, :, 0]
    strength = _strengths(groups, rows[None])[0]
    shuffled = _shuffled(table, rows, np.random.default_rng(seed))
    chance = _strengths(groups, shuffled)
    # A group that chance makes strong, by a few wild stops, has to be so much stronger.
    usual = np.maximum(chance.mean(axis=0), 1.0)
    strength = strength / usual
    place, scale = gumbel_r.fit((chance / usual).max(axis=1))
    found = []
    for i, axis in enumerate(axes):
        own = [j for j, g in enumerate(groups) if g.axis == i]
        if not own:
            continue
        best = max(own, key=lambda j: strength[j])
        p_value = float(gumbel_r.sf(strength[best], place, scale))
        found.append(space.followed(axis, groups[best], rows, float(strength[best]), p_value))
    return sorted(found, key=lambda f: -f.strength)


def mainly_along(located: list[Followed]) -> Followed | None:
    """The axis that takes most of the disagreement away, of those that are no chance."""
    certain = [f for f in located if f.p_value < LOCATED]
    return max(certain, key=lambda f: f.removed, default=None)


def _strengths(groups: list[_Group], residuals: Floats) -> Floats:
    """(R, groups) −log p of the chi square of each group for R residuals (R, S, K + 1)."""
    chi_square = np.empty((len(residuals), len(groups)))
    for whole in (True, False):
        own = [j for j, g in enumerate(groups) if g.whole == whole]
        if not own:
            continue
        rows = residuals if whole else residuals[:, :, :1]
        bases = np.concatenate([groups[j].basis for j in own], axis=1)
        along = rows.reshape(len(rows), -1) @ bases
        begins = np.cumsum([0, *(groups[j].basis.shape[1] for j in own[:-1])])
        chi_square[:, own] = np.add.reduceat(along**2, begins, axis=1)
    numbers = np.array([g.basis.shape[1] for g in groups])
    return -np.asarray(chi2.logsf(chi_square, numbers), np.float64)


def _shuffled(table: StopTable, rows: Floats, rng: np.random.Generator) -> Floats:
    """(R, S, K + 1) residuals with runs in another order and other signs."""
    run = np.unique(table.run, return_inverse=True)[1]
    by_run = np.argsort(run, kind="stable")
    ordered, run = rows[by_run], run[by_run]
    draws = np.empty((PERMUTATIONS, *rows.shape))
    count = int(run[-1]) + 1
    for draw in draws:
        place = rng.permutation(count)
        signs = rng.choice((-1.0, 1.0), count)
        order = np.argsort(place[run], kind="stable")
        np.multiply(ordered[order], signs[run][:, None], out=draw)
    return draws


class _Space:
    """Whitened rows (S, K + 1) of a fit, the friction of each stop first."""

    def __init__(self, table: StopTable, fit: Fit) -> None:
        self.table, self.fit, self.white = table, fit, fit.white
        self.columns = table.average @ fit.jacobian
        rows = self.rows(self.columns)
        self.flat = rows.reshape(-1, self.columns.shape[2])
        prior = np.diag(np.sqrt(prior_precision(fit.hypothesis)))
        self.base, _ = np.linalg.qr(np.concatenate((self.flat, prior)))
        u, size, _ = np.linalg.svd(rows[:, 0], full_matrices=False)
        self.base_between = u[:, size > 1e-9 * size[0]]

    def rows(self, bins: Floats) -> Floats:
        """(S, K + 1, P) of bins (S, K, P)."""
        return self.white.by_stop(self.white.bins @ bins)

    def groups(self, number: int, axis: Axis) -> list[_Group]:
        """All groups of shapes along an axis, by all rows and by frictions alone.

        What happens within stops may be far off for reasons of its own, and drown what differs
        from stop to stop.

        Args:
            number: of the axis, which groups bear.
        """
        shapes = shapes_of(axis)
        ends = np.cumsum([s.shape[2] for s in shapes])
        rows = self.rows(self._columns(np.concatenate(shapes, axis=2)))
        found = []
        for whole in (True, False) if axis.name not in _NOT_BY_FRICTION else (True,):
            base = self.base if whole else self.base_between
            own = rows.reshape(-1, ends[-1]) if whole else rows[:, 0]
            size = np.einsum("np,np->p", own, own)
            beyond = own - base[: len(own)] @ (base[: len(own)].T @ own)
            for index, (begin, end) in enumerate(zip([0, *ends[:-1]], ends, strict=True)):
                basis = _orthonormal(beyond[:, begin:end], float(size[begin:end].max()))
                if basis.shape[1]:
                    found.append(_Group(number, index, basis, whole))
        return found

    def _columns(self, shapes: Floats) -> Floats:
        """(S, K, p) fall of the speed by shapes of the force (S, M, p), in bins."""
        nothing = np.zeros(shapes.shape[2], np.bool_)
        fall: Floats = self.table.average @ integral(
            self.table, self.fit.hypothesis, shapes, nothing
        )
        return fall

    def followed(
        self, axis: Axis, group: _Group, rows: Floats, strength: float, p_value: float
    ) -> Followed:
        """What the best shapes along an axis look like, for rows (S, K + 1) of the residual."""
        shapes = shapes_of(axis)[group.member]
        columns = self._columns(shapes)
        own = self.rows(columns)
        flat, base = own.reshape(-1, shapes.shape[2]), self.flat
        seen = rows if group.whole else rows[:, :1]
        if not group.whole:
            flat, base = own[:, 0], self.rows(self.columns)[:, 0]
        along = group.basis.T @ seen.ravel()
        joint = np.concatenate((flat, base), axis=1)
        solution = np.linalg.lstsq(joint, group.basis @ along, rcond=1e-9)[0]
        taken = np.concatenate((columns, self.columns), axis=2) @ solution
        # Shares of the weight slow down: their sign is against that of the speed.
        share = -(shapes @ solution[: shapes.shape[2]])
        left = residual(self.table, self.fit.hypothesis)
        removed = self._mean_square(left) - self._mean_square(left - taken)
        chi_square = float(along @ along)
        distance = float(np.sqrt(np.mean(self._distance(taken) ** 2)))
        if not group.whole:  # friction alone: its share of what differs between stops
            total = float(np.sum(rows[:, 0] ** 2))
            removed = max(chi_square - len(along), 0.0) / total * self._mean_square(left)
            table = self.table
            off = np.mean(share - np.mean(share), axis=1) * table.held**2
            distance = float(np.sqrt(np.mean((off / (2.0 * GRAVITY * table.pull**2)) ** 2)))
        return Followed(axis, chi_square, len(along), strength, p_value, share, removed, distance)

    def _distance(self, speed: Floats) -> Floats:
        """(S,) integral of speeds in bins over each stop [m]."""
        used = self.table.spread > 0.0
        span = self.table.time[:, -1] - self.table.time[:, 0]
        mean: Floats = np.sum(speed * used, axis=1) / np.sum(used, axis=1)
        return mean * span

    def _mean_square(self, values: Floats) -> float:
        used = self.table.spread > 0.0
        return float(np.mean(values[used] ** 2))


def _orthonormal(columns: Floats, size: float) -> Floats:
    """(N, k) directions of columns (N, p), without those that are small beside a size squared."""
    squared, vectors = np.linalg.eigh(columns.T @ columns)
    large = squared > LEAST_DIRECTION * max(size, 1e-300)
    basis: Floats = columns @ (vectors[:, large] / np.sqrt(squared[large]))
    return basis


def part_of_axis(found: Followed) -> tuple[float, float]:
    """Where on its axis most of it sits: more than half of its largest departure from the usual."""
    off = found.share - np.median(found.share)
    low, high = np.quantile(off, [0.02, 0.98])
    strong = off >= 0.5 * high if high >= -low else off <= 0.5 * low
    values = found.axis.values[strong]
    begin, end = np.quantile(values, [0.02, 0.98])
    return float(begin), float(end)
