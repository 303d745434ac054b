"""Evidence of columns and noise under both priors of the coefficients, and its derivatives."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.gaussian import Grams, Solved, by_variances, solved
from slopewise.models.discrepancy.likelihood.trace import BASE_PLACES, EARLY_PLACES, HAT_PLACES


def of_noise(noise: Floats) -> float:
    """Ln of its prior, 0 where it is usual."""
    deviation = (np.log(noise) - np.log(prior.NOISE)) / prior.NOISE_SPREAD
    return -0.5 * float(deviation @ deviation)


def solved_both(
    grams: Grams, std: Floats, noise: Floats, calibrated: Floats, centre: Floats | None = None
) -> tuple[Solved, Solved]:
    """The first columns integrated out, with coefficients as calibrated and changed since then.

    ``calibrated``: (4,) deviations of coefficients that are as calibrated.
    """
    variance = prior.own_variance(noise, grams.square.shape[1])
    weighed, log_det, *_ = grams.whitened(noise[0], variance)
    before, changed = (
        solved(weighed, log_det, s, centre) for s in _both_stds(std, noise, calibrated)
    )
    return before, changed


def by_noise(
    grams: Grams, std: Floats, noise: Floats, calibrated: Floats, centre: Floats
) -> tuple[float, Floats]:
    """Evidence and prior of the noise, and (6,) derivatives by its logarithms."""
    variance = prior.own_variance(noise, grams.square.shape[1])
    weighed, log_det, solutions, inverse = grams.whitened(noise[0], variance)
    evidences, slopes = [], []
    for scaled in _both_stds(std, noise, calibrated):
        solution = solved(weighed, log_det, scaled, centre)
        mean, covariance = solution.mean, solution.covariance
        per_stop = 2.0 * by_variances(solutions, inverse, variance, mean, covariance)
        columns = ((mean - centre) ** 2 + np.diag(covariance)) / scaled**2 - 1.0
        left = np.append(-mean, 1.0)
        square = float(left @ weighed @ left) + float(np.sum(covariance * weighed[:-1, :-1]))
        # What scales all bins scales samples and own effects together.
        white = square - grams.rows - float(per_stop.sum())
        at_onset = [columns[places].sum() for places in (HAT_PLACES, EARLY_PLACES)]
        slopes.append([white, per_stop[3], per_stop[2], per_stop[4:].sum(), *at_onset])
        evidences.append(solution.evidence)
    evidence = mixed(*evidences)
    changed = share_changed(evidences[1], evidence)
    deviation = (np.log(noise) - np.log(prior.NOISE)) / prior.NOISE_SPREAD
    slope = (1.0 - changed) * np.array(slopes[0]) + changed * np.array(slopes[1])
    return evidence + of_noise(noise), slope - deviation / prior.NOISE_SPREAD


def _both_stds(std: Floats, noise: Floats, calibrated: Floats) -> tuple[Floats, Floats]:
    """(P,) deviations with coefficients as calibrated, and changed since then."""
    changed = with_onset(std, noise)
    as_calibrated = changed.copy()
    as_calibrated[BASE_PLACES] = calibrated
    return as_calibrated, changed


def with_onset(std: Floats, noise: Floats) -> Floats:
    """(P,) deviations with what the noise leaves at the onset."""
    scaled = std.copy()
    scaled[HAT_PLACES] *= noise[prior.ONSET_TIME]
    scaled[EARLY_PLACES] *= noise[prior.ONSET_FORCE]
    return scaled


def share_changed(changed: float, evidence: float) -> float:
    """Probability that coefficients have changed, by ln of that evidence and of both together."""
    return float(np.exp(np.log(prior.CHANGED) + changed - evidence))


def mixed(calibrated: Elementwise, changed: Elementwise) -> Elementwise:
    """Ln of the evidence of both priors of the coefficients together."""
    return np.logaddexp(np.log1p(-prior.CHANGED) + calibrated, np.log(prior.CHANGED) + changed)
