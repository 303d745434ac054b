"""What candidates would explain beyond a fit, how much of them it absorbs, and what would show.

Everything is done on what a stop tells in few numbers: its share along its own friction, which
scatters from stop to stop, and its share within, which only noise disturbs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.noise import Whitener
from slopewise.models.discrepancy.search.refine import Fit
from slopewise.models.discrepancy.thresholds import (
    CHANGED_STOPS,
    LEAST_COLUMN,
    OWN_SCATTERS,
)


@dataclass(frozen=True, slots=True)
class Reduced:
    """Columns of the base (P) and of candidates (Q) as sums over all stops.

    Attributes:
        base_within: (P, P). cross_within: (P, Q). own_within: (Q,).
        base_between: (S, P). between: (S, Q). power: (S,), see :class:`Whitener`.
        rows_base: (N, P), rows: (N, Q) whitened within.
        precision: (P,) of the prior.
    """

    base_within: Floats
    cross_within: Floats
    own_within: Floats
    base_between: Floats
    between: Floats
    power: Floats
    rows_base: Floats
    rows: Floats
    precision: Floats

    def blurred(self, blur: float) -> Reduced:
        """With noise within stops that many times as large."""
        less = 1.0 / blur**2
        return replace(
            self,
            base_within=less * self.base_within,
            cross_within=less * self.cross_within,
            own_within=less * self.own_within,
            rows_base=self.rows_base / blur,
            rows=self.rows / blur,
        )

    def at(self, scatter: float) -> _Projector:
        """For a friction scatter."""
        weight = 1.0 / (1.0 + scatter**2 * self.power)
        weighted = self.base_between * weight[:, None]
        normal = self.base_within + weighted.T @ self.base_between + np.diag(self.precision)
        cross = self.cross_within + weighted.T @ self.between
        inverse: Floats = np.asarray(np.linalg.pinv(normal, hermitian=True), np.float64)
        own = self.own_within + weight @ self.between**2
        left = own - np.einsum("pq,pq->q", cross, inverse @ cross)
        return _Projector(weight, inverse, cross, np.maximum(left, 0.0), own)


@dataclass(frozen=True, slots=True)
class _Projector:
    weight: Floats
    inverse: Floats
    cross: Floats
    left: Floats
    own: Floats

    @property
    def absorbed(self) -> Floats:
        """(Q,) share of each candidate's column that the base takes up."""
        share: Floats = 1.0 - self.left / np.maximum(self.own, 1e-300)
        return share


def reduced(white: Whitener, base: Floats, columns: Floats, precision: Floats) -> Reduced:
    """Sums over all stops.

    Args:
        white: transform of the log. base: (S, M, P) jacobian of the fit so far.
        columns: (S, M, Q) candidates. precision: (P,) of the prior.
    """
    return summed(
        white.split(white.grid @ base), white.split(white.grid @ columns), white.power, precision
    )


def summed(
    base: tuple[Floats, Floats], columns: tuple[Floats, Floats], power: Floats, precision: Floats
) -> Reduced:
    """As :func:`reduced`, from whitened columns: (S, P) along the friction and (S, K, P) within."""
    flat_base, flat = (within.reshape(-1, within.shape[2]) for _, within in (base, columns))
    return Reduced(
        flat_base.T @ flat_base,
        flat_base.T @ flat,
        np.einsum("nq,nq->q", flat, flat),
        base[0],
        columns[0],
        power,
        flat_base,
        flat,
        precision,
    )


@dataclass(frozen=True, slots=True)
class Scores:
    """Of each candidate, (Q,).

    Attributes:
        z: signed root of the chi square that it would explain at the scatter of the fit so far.
        gain: drop of −2 log likelihood with the scatter that belongs to the candidate itself; 0
            where the strength would have the wrong sign.
        strength: at its best.
    """

    z: Floats
    gain: Floats
    strength: Floats


def scores(
    sums: Reduced, residual: tuple[Floats, Floats], scatter: float, one_sided: Bools
) -> Scores:
    """What each candidate would explain of residuals.

    Args:
        residual: (S,) between and (N,) within, of measured less predicted speed.
        scatter: of the friction from stop to stop. one_sided: (Q,) strengths that must be positive.
    """
    between, within = residual[0][:, None], residual[1][:, None]
    here = _scored(sums, scatter, between, within)
    least = here[0]
    lowest, strength = np.full(len(one_sided), np.inf), np.zeros(len(one_sided))
    for factor in OWN_SCATTERS:
        cost, z, size = _scored(sums, factor * scatter, between, within)
        least = min(least, cost)
        able = np.where(one_sided & (z < 0.0), 0.0, z)
        better = cost - able**2 < lowest
        lowest = np.where(better, cost - able**2, lowest)
        strength = np.where(better, size, strength)
    return Scores(here[1], np.maximum(least - lowest, 0.0), strength)


def _scored(
    sums: Reduced, scatter: float, between: Floats, within: Floats
) -> tuple[float, Floats, Floats]:
    """−2 log likelihood without candidates; z and strength of each (Q,)."""
    on = sums.at(scatter)
    top = _tops(sums, on, between, within)[:, 0]
    left = np.where(on.left > LEAST_COLUMN * on.own, on.left, np.inf)
    weighted = on.weight * between[:, 0]
    base = sums.rows_base.T @ within[:, 0] + sums.base_between.T @ weighted
    cost = float(weighted @ between[:, 0] - base @ (on.inverse @ base) - np.sum(np.log(on.weight)))
    # More fall is less speed: a strength is positive where the residual is negative.
    return cost, -top / np.sqrt(left), -top / left


def _tops(sums: Reduced, on: _Projector, between: Floats, within: Floats) -> Floats:
    """(Q, B) of B residuals."""
    weighted = on.weight[:, None] * between
    top = sums.rows.T @ within + sums.between.T @ weighted
    base = sums.rows_base.T @ within + sums.base_between.T @ weighted
    result: Floats = top - on.cross.T @ (on.inverse @ base)
    return result


def visible(sums: Reduced, table: StopTable, fit: Fit, columns: Floats, needed: float) -> Floats:
    """(Q,) change of stops from which each candidate would have been seen [m].

    Args:
        sums: of the candidates. table: stops. fit: what is believed.
        columns: (S, M, Q) of the candidates. needed: chi square that chance exceeds too seldom.

    Beyond what new coefficients can do, so large that five logs of six would show it, in the stops
    that it changes most.
    """
    on = sums.at(fit.noise.scatter)
    left = np.where(on.left > LEAST_COLUMN * on.own, on.left, np.nan)
    strength = (np.sqrt(needed) + 1.0) / np.sqrt(left)
    step = table.time[:, 1] - table.time[:, 0]
    # Distances are linear in the columns: what new coefficients take up comes off afterwards.
    way = columns.sum(axis=1) * step[:, None]
    taken = (fit.jacobian.sum(axis=1) * step[:, None]) @ (on.inverse @ on.cross)
    size = np.sort(np.abs(way - taken), axis=0)[-CHANGED_STOPS] * strength
    return np.where(np.isfinite(size), size, np.inf)
