"""Along which axes, and where on them, a fit still disagrees with its log.

Each axis gets the chi square that shapes along it explain beyond the fit. What chance explains is
found by permuting runs and their signs; p-values are those of the largest of all axes, so that
trying many costs its price.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, gumbel_r

from models.arrays import Floats, Ints
from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.model.prediction import integral
from models.discrepancy.search.axes import Axis, axes_of, shapes_of
from models.discrepancy.search.refine import Fit, prior_precision, residual
from models.discrepancy.thresholds import LEAST_DIRECTION, PERMUTATIONS
from models.quantity import GRAVITY

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


@dataclass(frozen=True, slots=True)
class _Group:
    axis: int
    shapes: Floats
    columns: Floats
    basis: Floats
    counted: Ints


def follow(table: StopTable, fit: Fit, seed: int) -> list[Followed]:
    """All axes, the most telling first.

    Args:
        table: stops. fit: what is believed. seed: of the permutations.
    """
    axes = axes_of(table, fit.hypothesis)
    space = _Space(table, fit)
    groups = [
        group
        for i, axis in enumerate(axes)
        for shapes in shapes_of(axis)
        for group in space.groups(i, shapes, axis.name in _NOT_BY_FRICTION)
    ]  # fmt: skip
    groups = [g for g in groups if g.basis.shape[1] > 0]
    if not groups:  # too few stops to follow anything
        return []
    rows = space.rows(residual(table, fit.hypothesis)[:, :, None])[:, :, 0]
    strength = _strengths(groups, rows.reshape(1, -1))[0]
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


def _strengths(groups: list[_Group], residuals: Floats) -> Floats:
    """(R, groups) −log p of the chi square of each group for R residuals (R, N)."""
    result = np.empty((len(residuals), len(groups)))
    for j, group in enumerate(groups):
        along = residuals @ group.basis
        result[:, j] = -chi2.logsf(np.einsum("rp,rp->r", along, along), group.basis.shape[1])
    return result


def _shuffled(table: StopTable, rows: Floats, rng: np.random.Generator) -> Floats:
    """(R, N) residuals with runs in another order and other signs."""
    runs = [np.flatnonzero(table.run == r) for r in np.unique(table.run)]
    draws = np.empty((PERMUTATIONS, rows.size))
    for k in range(PERMUTATIONS):
        order = np.concatenate([runs[i] for i in rng.permutation(len(runs))])
        signs = np.concatenate([np.full(len(r), rng.choice((-1.0, 1.0))) for r in runs])
        draws[k] = (rows[order] * signs[:, None]).ravel()
    return draws


class _Space:
    """Whitened rows (S, K + 1) of a fit, the friction of each stop first."""

    def __init__(self, table: StopTable, fit: Fit) -> None:
        self.table, self.fit, self.white = table, fit, fit.white
        white = fit.white
        self.weight = 1.0 / np.sqrt(1.0 + white.noise.scatter**2 * white.power)
        self.columns = table.average @ fit.jacobian
        self.flat = self.rows(self.columns).reshape(-1, self.columns.shape[2])
        prior = np.diag(np.sqrt(prior_precision(fit.hypothesis)))
        self.base, _ = np.linalg.qr(np.concatenate((self.flat, prior)))
        self.count = len(self.flat)
        self.all = np.arange(self.count)
        self.between = self.all[:: table.binned.shape[1] + 1]
        u, s, _ = np.linalg.svd(self.flat[self.between], full_matrices=False)
        self.base_between = u[:, s > 1e-9 * s[0]]

    def rows(self, bins: Floats) -> Floats:
        """(S, K + 1, P) of bins (S, K, P)."""
        between, within = self.white.split(self.white.bins @ bins)
        return np.concatenate((between[:, None, :] * self.weight[:, None, None], within), axis=1)

    def groups(self, axis: int, shapes: Floats, whole: bool) -> list[_Group]:
        """Orthonormal directions of shapes (S, M, p) beyond the fit, by all rows and by friction.

        What happens within stops may be far off for reasons of its own, and drown what differs
        from stop to stop.
        """
        columns = self.table.average @ integral(
            self.table, self.fit.hypothesis, shapes, np.zeros(shapes.shape[2], np.bool_)
        )
        flat = self.rows(columns).reshape(self.count, -1)
        found = []
        for base, counted in ((self.base, self.all), (self.base_between, self.between)):
            own = flat[counted]
            size = float(np.max(np.einsum("np,np->p", own, own)))
            u, s, _ = np.linalg.svd(
                own - base[: len(own)] @ (base[: len(own)].T @ own), full_matrices=False
            )
            basis = np.zeros((self.count, int(np.sum(s**2 > LEAST_DIRECTION * max(size, 1e-300)))))
            basis[counted] = u[:, : basis.shape[1]]
            found.append(_Group(axis, shapes, columns, basis, counted))
            if whole:
                break
        return found

    def followed(
        self, axis: Axis, group: _Group, rows: Floats, strength: float, p_value: float
    ) -> Followed:
        """What the best shapes along an axis look like, for rows (S, K + 1) of the residual."""
        along = group.basis.T @ rows.ravel()
        flat = self.rows(group.columns).reshape(self.count, -1)
        wanted = group.basis @ along
        joint = np.concatenate((flat, self.flat), axis=1)
        counted = group.counted
        solution = np.linalg.lstsq(joint[counted], wanted[counted], rcond=1e-9)[0]
        taken = np.concatenate((group.columns, self.columns), axis=2) @ solution
        # Shares of the weight slow down: their sign is against that of the speed.
        share = -(group.shapes @ solution[: flat.shape[1]])
        left = residual(self.table, self.fit.hypothesis)
        own = self._mean_square(left) - self._mean_square(left - taken)
        chi_square = float(along @ along)
        distance = float(np.sqrt(np.mean(self._distance(taken) ** 2)))
        if len(counted) < self.count:  # friction alone: its share of what differs between stops
            total = float(np.sum(rows[:, 0] ** 2))
            own = max(chi_square - len(along), 0.0) / total * self._mean_square(left)
            table = self.table
            off = np.mean(share - np.mean(share), axis=1) * table.held**2
            distance = float(np.sqrt(np.mean((off / (2.0 * GRAVITY * table.pull**2)) ** 2)))
        return Followed(axis, chi_square, len(along), strength, p_value, share, own, distance)

    def _distance(self, speed: Floats) -> Floats:
        """(S,) integral of speeds in bins over each stop [m]."""
        used = self.table.spread > 0.0
        span = self.table.time[:, -1] - self.table.time[:, 0]
        mean: Floats = np.sum(speed * used, axis=1) / np.sum(used, axis=1)
        return mean * span

    def _mean_square(self, values: Floats) -> float:
        used = self.table.spread > 0.0
        return float(np.mean(values[used] ** 2))


def part_of_axis(found: Followed) -> tuple[float, float]:
    """Where on its axis most of it sits: more than half of its largest departure from the usual."""
    off = found.share - np.median(found.share)
    low, high = np.quantile(off, [0.02, 0.98])
    strong = off >= 0.5 * high if high >= -low else off <= 0.5 * low
    values = found.axis.values[strong]
    begin, end = np.quantile(values, [0.02, 0.98])
    return float(begin), float(end)
