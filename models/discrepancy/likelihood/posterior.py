"""Weights of all answers: every set, with and without a lag or changed coefficients."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.fit import HOPELESS, Fit
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS

LAG = next(name for name, law in LAWS.items() if law.enters is Enters.LAG)
"""Name of the effect that is an onset, not a column."""
_FINE = 120  # points of the integral over ln τ


@dataclass(frozen=True, slots=True)
class Explanation:
    """One answer.

    Attributes:
        names: of effects. axes: causes without a name.
        log_weight: ln of its weight. fit, at: and the build-up it holds at.
    """

    names: frozenset[str]
    axes: frozenset[str]
    log_weight: float
    fit: Fit
    at: int


def explanations(fits: Iterable[Fit], dead_time: float, odds: float) -> list[Explanation]:
    """Answers of refitted sets.

    Args:
        fits: refitted sets. dead_time: in the model file [s].
        odds: prior odds of causes, over those of :mod:`.prior`.
    """
    found = []
    for fit in fits:
        late = np.array([o.dead_time for o in fit.onsets])
        # A model has one lag: where there is one, what the onset lacks is dead time.
        has_lag = any(effect.name == LAG for effect in fit.trace.model.effect)
        for lag in (False,) if has_lag else (False, True):
            own = fit.log_prior + (np.log(odds * prior.NAME) if lag else 0.0)
            own += np.log(prior.FURTHER) if lag and fit.chosen else 0.0
            weight, at = _over_build_up(fit, late - dead_time, lag)
            names = frozenset(c.name for c in fit.chosen if c.named) | ({LAG} if lag else set())
            axes = frozenset(c.name for c in fit.chosen if not c.named)
            found.append(Explanation(names, axes, own + weight, fit, at))
    return sorted(found, key=lambda e: -e.log_weight)


def _over_build_up(fit: Fit, late: Floats, lag: bool) -> tuple[float, int]:
    """Logarithm of the integral over ln τ, and the index of its largest term."""
    taus, evidence = np.array([o.build_up for o in fit.onsets]), fit.evidence
    log_tau = np.log(taus)
    # A calibration took the usual build-up for dead time, and a lag that came later did not.
    off = late + (np.minimum(taus, prior.BUILD_UP) if lag else taus)
    usual = -0.5 * (off / prior.DEAD_TIME) ** 2
    fine = np.linspace(np.log(prior.SLOW[1]), np.log(prior.LAG[1]), _FINE)
    density = prior.of_lag(fine) if lag else prior.of_build_up(fine)
    lowest = float(evidence.min()) - HOPELESS
    followed = np.interp(fine, log_tau, evidence, left=lowest, right=lowest)
    terms = prior.TEMPER * followed + np.interp(fine, log_tau, usual)
    terms = terms + np.log(np.maximum(density, 1e-300))
    weight = float(logsumexp(terms) + np.log(fine[1] - fine[0]))
    return weight, int(np.argmin(np.abs(log_tau - fine[int(np.argmax(terms))])))
