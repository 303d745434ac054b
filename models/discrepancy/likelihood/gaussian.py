"""Evidence of linear Gaussian models of all stops; what differs between stops is integrated out.

For each stop V = σ² D + Z Λ Zᵀ with D from the samples of a bin, Z its own effects. With the Gram
matrices of one dictionary any noise is cheap: A = Λ⁻¹ + ZᵀD⁻¹Z/σ² is as small as Z has columns.
Source: Woodbury's identity, and the matrix determinant lemma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats


@dataclass(frozen=True, slots=True)
class Grams:
    """Products of columns, weighed by samples; the last column is what is to be explained.

    Attributes:
        total: (P, P) over all stops. per_stop: (S, R, P) of effects of each stop with all.
        square: (S, R, R) of them with one another. rows: number of bins. log_weight: Σ ln D.
    """

    total: Floats
    per_stop: Floats
    square: Floats
    rows: int
    log_weight: float

    @classmethod
    def of(cls, columns: Floats, per_stop: Floats, spread: Floats) -> Grams:
        """Of columns (S, K, P) and own effects (S, K, R), with variances (S, K) without σ²."""
        used = spread > 0.0
        weight = np.where(used, 1.0 / np.where(used, spread, 1.0), 0.0)
        root = np.sqrt(weight)[:, :, None]
        flat = (columns * root).reshape(-1, columns.shape[2])
        mine = np.swapaxes(per_stop * weight[:, :, None], 1, 2)
        return cls(
            flat.T @ flat,
            mine @ columns,
            mine @ per_stop,
            int(used.sum()),
            float(np.log(spread[used]).sum()),
        )

    def whitened(self, noise: float, variance: Floats) -> tuple[Floats, float, Floats, Floats]:
        """(P, P) columnsᵀ V⁻¹ columns, ln det V, (S, R, P) A⁻¹ZᵀD⁻¹ columns/σ², (S, R, R) A⁻¹.

        For σ [m/s] and Λ (R,) on its diagonal.
        """
        inner = self.square / noise**2 + np.diag(1.0 / variance)
        inverse = np.linalg.inv(inner)
        solutions = inverse @ (self.per_stop / noise**2)
        flat = self.per_stop.reshape(-1, self.per_stop.shape[2])
        weighed: Floats = (self.total - flat.T @ solutions.reshape(flat.shape)) / noise**2
        stops = len(self.square)
        log_det = self.rows * 2.0 * np.log(noise) + self.log_weight
        log_det += float(np.linalg.slogdet(inner)[1].sum()) + stops * float(np.log(variance).sum())
        return weighed, float(log_det), solutions, np.asarray(inverse, np.float64)


@dataclass(frozen=True, slots=True)
class Solved:
    """Columns that are always there, solved; and what they leave to others.

    Attributes:
        evidence: ln of the marginal likelihood. mean: (P,) of the columns.
        left: (Q, Q) precision of further columns after them. pull: (Q,) their right-hand side.
        covariance: (P, P) of the columns.
        changed: probability that coefficients have changed since the model file.
    """

    evidence: float
    mean: Floats
    left: Floats
    pull: Floats
    covariance: Floats
    changed: float = 1.0


def by_variances(
    solutions: Floats, inverse: Floats, variance: Floats, mean: Floats, covariance: Floats
) -> Floats:
    """(R,) derivatives of the evidence by ln Λ.

    Fisher's identity: half of E[z²]/λ − 1 of each stop's own effects z, given all bins.

    Args:
        solutions, inverse: as :meth:`Grams.whitened` returns them. variance: (R,) Λ.
        mean, covariance: (P,), (P, P) of the columns, given all bins.
    """
    count = len(mean)
    left, of_columns = solutions[:, :, -1] - solutions[:, :, :count] @ mean, solutions[:, :, :count]
    square = left**2 + np.einsum("srr->sr", inverse)
    square += np.einsum("srp,srp->sr", of_columns @ covariance, of_columns)
    result: Floats = 0.5 * (square / variance - 1.0).sum(axis=0)
    return result


def solved(weighed: Floats, log_det: float, std: Floats, centre: Floats | None = None) -> Solved:
    """Integrate out the first columns, whose prior is normal with these deviations (P,).

    Args:
        weighed: (P + Q + 1, …) products; the last one is of what is to be explained.
        log_det: ln det of the noise. std: (P,). centre: (P,) means of the prior, 0 without.
    """
    p = len(std)
    rest = slice(p, len(weighed) - 1)
    square = float(weighed[-1, -1])
    pull = weighed[:p, -1].copy()
    extra = weighed[rest, -1].copy()
    if centre is not None:
        square += float(centre @ weighed[:p, :p] @ centre - 2.0 * centre @ weighed[:p, -1])
        pull -= weighed[:p, :p] @ centre
        extra -= weighed[rest, :p] @ centre
    inner = weighed[:p, :p] + np.diag(1.0 / std**2)
    factor = np.linalg.cholesky(inner)
    root = np.linalg.inv(factor)
    covariance = root.T @ root
    mean = covariance @ pull
    evidence = -0.5 * (square - float(pull @ mean)) - 0.5 * log_det
    evidence -= float(np.log(np.diag(factor)).sum()) + float(np.log(std).sum())
    cross = weighed[:p, rest]
    left = weighed[rest, rest] - cross.T @ (covariance @ cross)
    offset = 0.0 if centre is None else centre
    return Solved(evidence, mean + offset, left, extra - cross.T @ mean, covariance)
