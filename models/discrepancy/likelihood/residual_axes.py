"""Along which axes, and where on them, refitted coefficients still disagree with a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.axes import Axis, axes_of
from slopewise.models.discrepancy.likelihood.onset import Integrated, Moment
from slopewise.models.discrepancy.likelihood.refit import Refit, jacobian, residual
from slopewise.models.discrepancy.likelihood.trace import Trace

WITHIN = ("speed", "time_since_onset", "brake_heat")
"""Axes that run through each stop; all others differ from stop to stop."""
ROUNDING = 1e-4  # share of a column, or of the largest, below which one is rounding [1]


@dataclass(frozen=True, slots=True)
class ResidualAxis:
    """An axis that a disagreement follows.

    Attributes:
        axis: with its values. p_value: corrected for all axes and shapes.
        strength: −ln p before that.
        share: (S, M) of the weight that the best shapes add along each stop.
        removed: mean square of the residual speeds that they take away [m²/s²].
    """

    axis: Axis
    p_value: float
    strength: float
    share: Floats
    removed: float

    @property
    def part(self) -> tuple[float, float]:
        """Where most of it sits: more than half of its largest departure from the usual."""
        deviation = self.share - np.median(self.share)
        low, high = np.quantile(deviation, [0.02, 0.98])
        strong = deviation >= 0.5 * high if high >= -low else deviation <= 0.5 * low
        begin, end = np.quantile(self.axis.values[strong], [0.02, 0.98])
        return float(begin), float(end)


def residual_axes(trace: Trace, fit: Refit) -> list[ResidualAxis]:
    """All axes, the strongest first."""
    table, whitener = trace.table, fit.whitener
    axes = axes_of(table, fit.hypothesis.dead_time)
    tried = [(axis, shapes) for axis in axes for shapes in axis.shapes]
    shares = np.concatenate([shapes for _, shapes in tried], axis=2)
    moment = Moment.of(trace.samples, whitener.onset)
    falls = Integrated.of(table, shares, np.zeros(shares.shape[2], bool))
    columns = falls.fallen(table, whitener.onset, moment)
    base, left = jacobian(table, fit.hypothesis), residual(table, fit.hypothesis)
    rows = whitener.rows(np.concatenate([left[:, :, None], columns], axis=2))
    orthonormal, _ = np.linalg.qr(whitener.rows(base))
    beyond = rows - orthonormal @ (orthonormal.T @ rows)
    best: dict[str, tuple[float, Axis, Floats, Floats]] = {}
    first = 0
    for axis, shapes in tried:
        within = slice(first, first + shapes.shape[2])
        first = within.stop
        strength, mean = _explained(beyond[:, 0], beyond[:, 1:][:, within], rows[:, 1:][:, within])
        if axis.name not in best or strength > best[axis.name][0]:
            best[axis.name] = strength, axis, -(shapes @ mean), columns[:, :, within] @ mean
    used = table.spread > 0.0
    axes_found = [
        ResidualAxis(
            axis,
            float(-np.expm1(len(tried) * np.log1p(-np.exp(-max(strength, 1e-12))))),
            strength,
            share,
            _removed(left[used], taken[used], base[used]),
        )
        for strength, axis, share, taken in best.values()
    ]
    return sorted(axes_found, key=lambda f: -f.strength)


def mainly_along(located: list[ResidualAxis]) -> ResidualAxis | None:
    """The axis that takes most of the disagreement away, of those that are no chance."""
    certain = [f for f in located if f.p_value < prior.RULED_OUT]
    return max(certain, key=lambda f: f.removed, default=None)


def _explained(left: Floats, beyond: Floats, rows: Floats) -> tuple[float, Floats]:
    """−ln p of the tempered chi square of shapes (N, p) beyond the base, and their means (p,)."""
    squared, vectors = np.linalg.eigh(beyond.T @ beyond)
    large = squared > ROUNDING * float(np.einsum("np,np->p", rows, rows).max())
    if not large.any():
        return 0.0, np.zeros(beyond.shape[1])
    directions = vectors[:, large]
    along = directions.T @ (beyond.T @ left)
    mean = directions @ (along / squared[large])
    chi_square = prior.TEMPER * float(np.sum(along**2 / squared[large]))
    strength = -float(chi2.logsf(chi_square, int(large.sum())))
    return strength, mean


def _removed(left: Floats, taken: Floats, base: Floats) -> float:
    """Mean square of residuals (N,) that shapes take away, coefficients (N, P) apart."""
    orthonormal, _ = np.linalg.qr(base)
    beyond = taken - orthonormal @ (orthonormal.T @ taken)
    return float(np.mean(left**2) - np.mean((left - beyond) ** 2))
