"""Stops that brake alike, and weaker than the others: a second state of the same brakes.

Wet shoes, a circuit that failed, another payload: a share of the stops has ρ times the force of the
others. Left out, they would be forgotten; taken for scatter, one wide margin would smother all
plans. Fewer stops than make a law of their own, or such as are not alike, are a state as well where
the scatter of the others does not reach them; how unlike they are widens it.

Shares of the predicted force, y = F / F̂ − 1, are explained by two normal laws with one
width. The two have to explain the stops better by :data:`_BETTER` in log-likelihood than one heavy
tailed law does, and the weak ones have to be at least :data:`FEWEST`, :data:`_APART` widths away.

Validity: states that nobody can foresee; those that a column of the log tells are surfaces.
Source: none; expectation–maximisation of a mixture, Dempster et al. 1977.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.scatter import DOUBT, QUANTILES

FEWEST = 4
"""Stops that are enough to be told from the tail of the others by being alike."""

_BETTER = 4.0
"""Gain of log-likelihood that a second state needs [1]: χ² of 8 for its share, force and width, 95
% of a distribution with three degrees of freedom."""
_APART = 3.0
"""Distance between two states in widths of either [1]; closer ones overlap and are one wide law."""
_SHARES = (0.05, 0.1, 0.2, 0.35)  # of weak stops to begin with
_MOST = 0.5  # from there on the weak ones are the brakes
_PASSES = 200
"""Passes of expectation and maximisation at most [1]."""
_FREEDOM = (2.0, 3.0, 5.0, 10.0, 1000.0)
"""Degrees of freedom tried for the law with one state [1], from heavy tails to normal."""
_LEAST = 1e-4
"""Smallest width of a state, F_b/W over its prediction [1]: below every sensor, keeps 1/width
finite."""
_HALF_LOG_TAU = -0.5 * float(np.log(2.0 * np.pi))  # of a normal law, logarithm at its middle
_BORROWED = 6.0  # stops that the width of the others counts for


@dataclass(frozen=True, slots=True)
class WeakerState:
    """A state in which the brakes are weaker.

    Attributes:
        members: (n,) stops that were in it. ratio: its force as a share of the usual one.
        ratio_std: of the ratio. scatter: of a stop's force in it, as a share of its own force;
            to plan with.
    """

    members: Bools
    ratio: float
    ratio_std: float
    scatter: float


def weaker_members(share: Floats, noise: Floats) -> Bools:
    """(n,) stops that are in a weak state of their own; none where there is no such state.

    Args:
        share: (n,) F / F̂ − 1. noise: (n,) of it.
    """
    none = np.zeros(len(share), np.bool_)
    if len(share) < 3 * FEWEST:
        return none
    best, members = -np.inf, none
    for begin in _SHARES:
        likely, weak, apart = _two(share, noise, share < np.quantile(share, begin))
        enough = FEWEST <= int(weak.sum()) <= _MOST * len(share)
        if enough and apart > _APART and likely > best:
            best, members = likely, weak
    return members if best > _one(share, noise) + _BETTER else none


def _two(share: Floats, noise: Floats, weak: Bools) -> tuple[float, Bools, float]:
    """Log-likelihood of two laws, the stops of the lower one, and how many widths they differ."""
    chance = np.where(weak, 0.95, 0.05)
    likely = -np.inf
    for _ in range(_PASSES):
        weight = np.stack((1.0 - chance, chance))
        total = np.maximum(weight.sum(axis=1), 1e-9)
        middle = (weight @ share) / total
        spread = np.sum(weight * (share - middle[:, None]) ** 2) / len(share)
        width = np.sqrt(max(spread - float(np.mean(noise**2)), _LEAST**2) + noise**2)
        parts = _HALF_LOG_TAU - np.log(width) - 0.5 * ((share - middle[:, None]) / width) ** 2
        parts += np.log(np.maximum(total / len(share), 1e-12))[:, None]
        each = np.logaddexp(*parts)
        chance = np.exp(parts[1] - each)
        now = float(each.sum())
        if abs(now - likely) < 1e-6:
            break
        likely = now
    apart = float(middle[0] - middle[1]) / float(np.median(width))
    return likely, chance > 0.5, apart


def _one(share: Floats, noise: Floats) -> float:
    """Log-likelihood of one law, whatever its tails."""
    middle = float(np.median(share))
    spread = max(1.4826 * float(np.median(np.abs(share - middle))), _LEAST)
    width = np.hypot(spread * np.geomspace(0.2, 10.0, 80)[:, None], noise)
    return max(
        float(np.max(np.sum(stats.t.logpdf((share - m) / width, nu) - np.log(width), axis=1)))
        for nu in _FREEDOM
        for m in (middle, float(np.mean(share)))
    )


def weaker_state(share: Floats, noise: Floats, members: Bools, usual: float) -> WeakerState:
    """The state that some stops were in.

    Args:
        share: (n,) F / F̂ − 1 by a fit of the other stops. noise: (n,) of it.
        members: (n,) its stops, at least one.
        usual: scatter to expect in it, as a share of the force of the others.
    """
    own, count = share[members] + 1.0, int(members.sum())
    ratio = float(np.mean(own))
    freedom = _BORROWED + count - 1
    deviations = float(np.sum((own - ratio) ** 2))
    variance = (_BORROWED * usual**2 + deviations) / freedom
    spread = np.sqrt(variance * freedom / stats.chi2.ppf(DOUBT, freedom))
    error = float(np.sqrt(variance + np.mean(noise[members] ** 2)) / np.sqrt(count))
    # Of all stops only a share is in the state: the quantile of all is a lower one of its own.
    most = float(stats.beta.ppf(1.0 - DOUBT, count + 1, len(share) - count))
    widths = [
        max(float(stats.norm.ppf(1.0 - min((1.0 - q) / most, 0.5)) / stats.norm.ppf(q)), 0.0)
        for q in QUANTILES
    ]
    return WeakerState(members, ratio, error, max(widths) * float(spread) / max(ratio, _LEAST))
