"""How stops scatter, out of residuals: the one way from what was measured to a quantile.

A residual is what one stop missed its prediction by, so that the dangerous side is negative: less
force, or a later onset with its sign turned. Its law is Student's t with location zero and unknown
scale σ and degrees of freedom ν, widened by the measurement noise s of the stop itself:

    e ~ t_ν(0, √(σ² + s²)),   p(log σ) even,   p(ν) of :data:`_FREEDOM`.

On a grid of σ and ν the posterior is a sum. From it come three things, and nothing else is made of
residuals: the predictive distribution of the next stop (its share of PIT is even, which is tested),
the typical scatter, and the scatter to plan with. The last is the upper end of what the stops leave
open of the quantile: Q = σ t_ν⁻¹(q) exceeds it with a chance of :data:`DOUBT`. It is told as the
standard deviation of the normal distribution that has that quantile, since plans take it times the
normal width z(q); where the tails are heavy, it is the largest over the quantiles of
:data:`QUANTILES`. Few stops leave more open, so that it is wider for them.

Residuals on the harmless side count as no farther than :data:`_HARMLESS` typical ones: how much
stronger a stop may be tells nothing of how weak.

Validity: stops that are independent; quantiles up to the last of :data:`QUANTILES`. What no stop of
the log resembles is not in it. Source: none; Student's t as a scale mixture, Lange et al. 1989.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from slopewise.models.arrays import Floats

DOUBT = 0.2
"""Chance that the quantile is farther out than the scatter to plan with says."""

QUANTILES = (0.99, 0.999)
"""At which the scatter to plan with holds."""

_FREEDOM = {3.0: 0.10, 4.0: 0.08, 6.0: 0.10, 10.0: 0.12, 30.0: 0.20, 1000.0: 0.40}
"""Degrees of freedom and what they are worth before a stop was seen."""

_HARMLESS = 2.5
"""Typical residuals at which the harmless side is cut [1]: a much stronger stop shows little about
how weak another may be."""
_MAD = 1.4826
"""Standard deviation of a normal law over its median absolute deviation [1]."""
_SCALES = 121
"""Widths on the grid of the likelihood [1]: steps of 5 %, below the error of any estimate of
width."""
_SPAN = (0.02, 8.0)  # of the typical residual: scales that are tried
_LEAST = 1e-6
"""Smallest spread [unit of the residuals]: keeps a log without scatter from a division by zero."""


@dataclass(frozen=True, slots=True)
class Scatter:
    """What residuals told of the next stop.

    Attributes:
        typical: standard deviation that is as likely too small as too large.
        planned: the same to plan with, see the head of the file.
        scale, freedom: (K,) of the grid. weight: (K,) posterior, sums to one.
    """

    typical: float
    planned: float
    scale: Floats
    freedom: Floats
    weight: Floats

    def below(self, residual: Floats) -> Floats:
        """(n,) chance that a stop without measurement noise has a lower residual than these."""
        x = np.asarray(residual, np.float64)[..., None]
        result: Floats = stats.t.cdf(x / self.scale, self.freedom) @ self.weight
        return result


def scatter_of(residual: Floats, noise: Floats, doubt: float = DOUBT) -> Scatter:
    """The scatter behind residuals.

    Args:
        residual: (n,) as of stops that the prediction has not seen, dangerous side negative.
        noise: (n,) standard deviations of their measurement, in the same unit.
        doubt: chance that the quantile is farther out than planned with.

    Raises:
        ValueError: no residual.
    """
    if len(residual) == 0:
        raise ValueError("residuals of at least one stop")
    spread = _MAD * float(np.median(np.abs(residual)))
    spread = max(spread, 0.1 * float(np.sqrt(np.mean(np.square(residual)))), _LEAST)
    usual = float(np.hypot(spread, np.median(noise)))
    seen = np.minimum(residual, _HARMLESS * usual)
    scales = spread * np.geomspace(*_SPAN, _SCALES)
    freedom = np.array(list(_FREEDOM))
    grid, free = (a.ravel() for a in np.meshgrid(scales, freedom, indexing="ij"))
    width = np.hypot(scales[:, None], noise)
    likely = np.concatenate(
        [
            np.sum(stats.t.logpdf(seen / width, nu) - np.log(width), axis=1)[:, None]
            for nu in freedom.tolist()
        ],
        axis=1,
    ).ravel()
    prior = np.tile(np.log(np.array(list(_FREEDOM.values()))), len(scales))
    weight = np.exp(likely + prior - np.max(likely + prior))
    weight /= weight.sum()
    planned = 0.0
    for q in QUANTILES:
        far = grid * stats.t.ppf(q, free) / stats.norm.ppf(q)
        planned = max(planned, _upper(far, weight, 1.0 - doubt))
    typical = _upper(grid * stats.t.ppf(0.841, free), weight, 0.5)
    return Scatter(typical, planned, grid, free, weight)


def _upper(values: Floats, weight: Floats, share: float) -> float:
    """Value below which a share of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order][min(int(np.searchsorted(total, share)), len(values) - 1)])
