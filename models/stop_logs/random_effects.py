"""Robust weighted least squares for measurements that scatter more than their own noise.

Each observation has a measurement variance that is known and a share in a scatter that is not:
stops differ from each other by more than their sensors err. The scatter is estimated by restricted
maximum likelihood, observations that fit neither are rejected, and the covariance is scaled by what
the residuals show (Knapp and Hartung 2003).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import ndtri

from slopewise.models.arrays import Bools, Floats

_REJECT = 4.0  # standard deviations: one good observation in 16,000 is lost
_PASSES = 20  # iterations of mean and spread at most; it ends by its tolerance
PER_MAD = 1.4826
"""Standard deviation of a normal law over its median absolute deviation [1]."""
_BY_OBSERVATION = ("kept", "residuals", "variance", "gain")
_MAX_REJECTED_SHARE = 0.4
"""Share of values that may be rejected as outliers [1]: below the half at which a median breaks
down."""


@dataclass(frozen=True, slots=True)
class LinearFit:
    """Coefficients of y = X β with what is known of them."""

    coefficients: Floats  # (p,)
    covariance: Floats  # (p, p)
    scatter: float  # standard deviation of observations beyond the measurement noise
    kept: Bools  # words: ok, (n,) observations that the fit rests on
    residuals: Floats  # (n,) y − X β of all
    variance: Floats  # (n,) measurement noise and scatter together
    gain: Floats  # (p, n) change of the coefficients with each observation, 0 for rejected ones


@dataclass(frozen=True, slots=True)
class Bounds:
    """Lower bounds of some values: (k, p) design, (k,) observed bound, (k,) its noise."""

    design: Floats
    observed: Floats
    noise: Floats


def fit_with_bounds(
    design: Floats,
    observed: Floats,
    noise: Floats,
    prior_mean: Floats,
    prior_covariance: Floats,
    bounds: Bounds | None,
) -> LinearFit:
    """Fit as :func:`fit`, raised to lower bounds that it would clearly contradict.

    A bound that the fit obeys is ignored, so that many of them do not add up; one far beyond
    any observation is an error.
    """
    result = fit(design, observed, noise, prior_mean, prior_covariance)
    if bounds is None:
        return result
    n, broken = len(observed), np.zeros(len(bounds.observed), np.bool_)
    # With this number of bounds, noise alone lifts one beyond that in two logs.
    z_score = -float(ndtri(0.5 / (len(broken) + 1.0)))
    while True:
        std = np.hypot(bounds.noise, result.scatter)
        lowest = bounds.observed - z_score * std
        short = lowest - bounds.design @ result.coefficients
        now = broken | ((short > 0.0) & (short <= _REJECT * std))
        if (now == broken).all():
            return result
        broken = now
        design_too = np.concatenate((design, bounds.design[now]))
        observed_too = np.concatenate((observed, lowest[now]))
        noise_too = np.concatenate((noise, std[now]))
        joint = fit(design_too, observed_too, noise_too, prior_mean, prior_covariance)
        rows = {name: getattr(joint, name)[..., :n] for name in _BY_OBSERVATION}
        result = dataclasses.replace(joint, **rows)


def fit_mean(observed: Floats, noise: Floats, prior_mean: float, prior_std: float) -> LinearFit:
    """Fit of one value that all observations (n,) have in common."""
    ones = np.ones((len(observed), 1))
    return fit(ones, observed, noise, np.array([prior_mean]), np.array([[prior_std**2]]))


def fit(
    design: Floats, observed: Floats, noise: Floats, prior_mean: Floats, prior_covariance: Floats
) -> LinearFit:
    """Fit with a weak prior, which decides only where the observations carry no information.

    ``noise``: (n,) standard deviations of the measurement.
    """
    information: Floats = np.asarray(np.linalg.inv(prior_covariance), np.float64)
    every = _Observations(design, observed, noise, prior_mean, information)
    residuals = observed - design @ every.start()
    center = float(np.median(residuals))
    spread = PER_MAD * float(np.median(np.abs(residuals - center)))
    scatter = np.sqrt(max(spread**2 - float(np.median(noise)) ** 2, 0.0))
    kept = every.within(residuals, scatter)
    for _ in range(_PASSES):
        inliers = every.of(kept)
        scatter = inliers.scatter()
        beta, _ = inliers.solve(inliers.noise**2 + scatter**2)
        again = every.within(observed - design @ beta, scatter)
        if (again == kept).all():
            break
        kept = again
    return every.result(kept, scatter)


class _Observations(NamedTuple):
    """Observations y (n,) with design (n, p) and noise (n,), and the prior of their coefficients.

    Attributes:
        mean: (p,) of the prior. information: (p, p) inverse of its covariance.
    """

    design: Floats
    observed: Floats
    noise: Floats
    mean: Floats
    information: Floats

    def of(self, kept: Bools) -> _Observations:
        """Those of which ``kept`` (n,) is True."""
        return _Observations(
            self.design[kept], self.observed[kept], self.noise[kept], self.mean, self.information
        )

    def start(self) -> Floats:
        """Where gross errors pull little: absolute residuals, their squares only near zero."""
        root = np.linalg.cholesky(self.information).T
        scale = max(float(np.median(self.noise)), 1e-6)
        weight = 1.0 / np.maximum(self.noise, scale)
        jacobian = np.concatenate((-self.design * weight[:, None], root))

        def residual(beta: Floats) -> Floats:
            left = (self.observed - self.design @ beta) * weight
            return np.concatenate((left, root @ (beta - self.mean)))

        # A copy each time: a robust loss scales it in place.
        solution = least_squares(residual, self.mean, jac=lambda _: jacobian.copy(), loss="soft_l1")
        return np.asarray(solution.x, np.float64)

    def within(self, residuals: Floats, scatter: float) -> Bools:
        """(n,) residuals that are no outliers."""
        scaled = np.abs(residuals) / np.sqrt(self.noise**2 + scatter**2 + 1e-18)
        return scaled <= max(_REJECT, float(np.quantile(scaled, 1.0 - _MAX_REJECTED_SHARE)))

    def solve(self, variance: Floats) -> tuple[Floats, Floats]:
        """Coefficients (p,) and their covariance (p, p) at variances (n,)."""
        weighted = self.design / variance[:, None]
        normal = self.design.T @ weighted + self.information
        covariance: Floats = np.asarray(np.linalg.inv(normal), np.float64)
        return covariance @ (weighted.T @ self.observed + self.information @ self.mean), covariance

    def scatter(self) -> float:
        """Restricted maximum likelihood of the standard deviation of the random effect."""

        def cost(log_scatter: float) -> float:
            variance = self.noise**2 + np.exp(2.0 * log_scatter)
            beta, covariance = self.solve(variance)
            residual, shift = self.observed - self.design @ beta, beta - self.mean
            quadratic = residual @ (residual / variance) + shift @ self.information @ shift
            return float(np.sum(np.log(variance)) - np.linalg.slogdet(covariance)[1] + quadratic)

        even = np.full(len(self.noise), float(np.median(self.noise)) ** 2 + 1e-12)
        typical = max(float(np.std(self.observed - self.design @ self.solve(even)[0])), 1e-9)
        low, high = np.log(1e-3 * typical), np.log(10.0 * typical)
        best = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 1e-3})
        return float(np.exp(best.x))

    def result(self, kept: Bools, scatter: float) -> LinearFit:
        """The fit that rests on those of which ``kept`` (n,) is True."""
        variance = self.noise**2 + scatter**2
        beta, covariance = self.of(kept).solve(variance[kept])
        residuals, p = self.observed - self.design @ beta, len(beta)
        freedom = max(int(kept.sum()) - p, 1)
        shown = max(float(np.sum(residuals[kept] ** 2 / variance[kept])) / freedom, 1.0)
        gain = np.zeros((p, len(residuals)))
        gain[:, kept] = covariance @ (self.design[kept] / variance[kept][:, None]).T
        return LinearFit(beta, covariance * shown, scatter, kept, residuals, variance * shown, gain)
