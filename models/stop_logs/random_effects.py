"""Robust weighted least squares for measurements that scatter more than their own noise.

Each observation has a measurement variance that is known and a share in a scatter that is not:
stops differ from each other by more than their sensors err. The scatter is estimated by restricted
maximum likelihood, observations that fit neither are rejected, and the covariance is scaled by what
the residuals show (Knapp and Hartung 2003).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

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


def fit(
    design: Floats,
    observed: Floats,
    noise: Floats,
    prior_mean: Floats,
    prior_covariance: Floats,
    *,
    reject: float = _REJECT,
) -> LinearFit:
    """Fit with a weak prior, which decides only where the observations carry no information.

    ``noise``: (n,) standard deviations of the measurement; ``reject``: those from which one is
    rejected.
    """
    information: Floats = np.asarray(np.linalg.inv(prior_covariance), np.float64)
    start = _start(design, observed, noise, prior_mean, information)
    residuals = observed - design @ start
    center = float(np.median(residuals))
    spread = PER_MAD * float(np.median(np.abs(residuals - center)))
    scatter = np.sqrt(max(spread**2 - float(np.median(noise)) ** 2, 0.0))
    kept = _within(residuals, noise, scatter, reject)
    beta = start
    for _ in range(_PASSES):
        scatter = _scatter(design[kept], observed[kept], noise[kept], information, prior_mean)
        beta = _solve(
            design[kept], observed[kept], noise[kept] ** 2 + scatter**2, information, prior_mean
        )[0]
        residuals = observed - design @ beta
        again = _within(residuals, noise, scatter, reject)
        if (again == kept).all():
            break
        kept = again
    return _result(design, observed, noise, scatter, kept, information, prior_mean)


def _start(design: Floats, observed: Floats, noise: Floats, mean: Floats, info: Floats) -> Floats:
    """Where gross errors pull little: absolute residuals are used, their squares only near zero."""
    root = np.linalg.cholesky(info).T
    scale = max(float(np.median(noise)), 1e-6)
    weight = 1.0 / np.maximum(noise, scale)
    jacobian = np.concatenate((-design * weight[:, None], root))

    def residual(beta: Floats) -> Floats:
        return np.concatenate(((observed - design @ beta) * weight, root @ (beta - mean)))

    # A copy each time: a robust loss scales it in place.
    solution: Floats = least_squares(
        residual, mean, jac=lambda _: jacobian.copy(), loss="soft_l1"
    ).x
    return solution


def _within(residuals: Floats, noise: Floats, scatter: float, reject: float) -> Bools:
    scaled = np.abs(residuals) / np.sqrt(noise**2 + scatter**2 + 1e-18)
    limit = max(reject, float(np.quantile(scaled, 1.0 - _MAX_REJECTED_SHARE)))
    return scaled <= limit


def _solve(
    design: Floats, observed: Floats, variance: Floats, info: Floats, mean: Floats
) -> tuple[Floats, Floats]:
    weighted = design / variance[:, None]
    normal = design.T @ weighted + info
    covariance: Floats = np.asarray(np.linalg.inv(normal), np.float64)
    beta: Floats = covariance @ (weighted.T @ observed + info @ mean)
    return beta, covariance


def _scatter(design: Floats, observed: Floats, noise: Floats, info: Floats, mean: Floats) -> float:
    """Restricted maximum likelihood of the standard deviation of the random effect."""

    def cost(log_scatter: float) -> float:
        variance = noise**2 + np.exp(2.0 * log_scatter)
        beta, covariance = _solve(design, observed, variance, info, mean)
        residual = observed - design @ beta
        shift = beta - mean
        quadratic = residual @ (residual / variance) + shift @ info @ shift
        return float(np.sum(np.log(variance)) - np.linalg.slogdet(covariance)[1] + quadratic)

    even = np.full(len(noise), float(np.median(noise)) ** 2 + 1e-12)
    left = observed - design @ _solve(design, observed, even, info, mean)[0]
    typical = max(float(np.std(left)), 1e-9)
    low, high = np.log(1e-3 * typical), np.log(10.0 * typical)
    best = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 1e-3})
    return float(np.exp(best.x))


def _result(
    design: Floats,
    observed: Floats,
    noise: Floats,
    scatter: float,
    kept: Bools,
    info: Floats,
    mean: Floats,
) -> LinearFit:
    variance = noise**2 + scatter**2
    beta, covariance = _solve(design[kept], observed[kept], variance[kept], info, mean)
    residuals = observed - design @ beta
    freedom = max(int(kept.sum()) - design.shape[1], 1)
    shown = float(np.sum(residuals[kept] ** 2 / variance[kept])) / freedom
    gain = np.zeros((design.shape[1], len(observed)))
    gain[:, kept] = covariance @ (design[kept] / variance[kept][:, None]).T
    shown = max(shown, 1.0)
    return LinearFit(beta, covariance * shown, scatter, kept, residuals, variance * shown, gain)
