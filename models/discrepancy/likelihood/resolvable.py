"""Effects that a log could have shown, and those that new coefficients hide.

An effect whose share of the force is the same in all stops, up to what the coefficients can do, is
absorbed by them; so is a pitch sensor that is mounted askew. Where the model as configured with a
single such cause explains the log as well as new coefficients, the log cannot distinguish them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Dictionary
from slopewise.models.discrepancy.likelihood.fit import Fit
from slopewise.models.discrepancy.likelihood.gaussian import Grams
from slopewise.models.discrepancy.likelihood.marginal import with_onset
from slopewise.models.discrepancy.likelihood.onset import Integrated
from slopewise.models.discrepancy.likelihood.residual_axes import ROUNDING
from slopewise.models.discrepancy.likelihood.trace import BASE_PLACES, Trace, columns_at
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import demanded_force
from slopewise.models.effects.registry import LAWS
from slopewise.models.stop_logs.mount_offset import TYPICAL_MOUNTING_STD

GRADE_BIAS = "grade_bias"
"""A pitch sensor or a map that is off by the same angle everywhere."""
CHANGED_STOPS = 3  # stops that an effect has to change to matter: two are outliers [1]
NAMED_FROM = 12.0
"""Chi square from which a name outweighs none: odds of 0.08, and the width of its prior [1]."""
_BIAS = np.sqrt(2.0) * TYPICAL_MOUNTING_STD
"""Standard deviation of all grades together, by the mountings now and when calibrated [rad]."""
_ABSORBED = 0.98  # share of a column that the base absorbs, from which it hides it [1]
_BIAS_TEST = (
    "stand still on ground of known slope, or drive the same slope both ways, and read the pitch; "
    "or coast: without brakes a wrong grade shows and brakes do not"
)


@dataclass(frozen=True, slots=True)
class Resolvable:
    """Of each effect, by name.

    Attributes:
        visible: change of a stop, beyond new coefficients, from which five logs of six like this
            one name it [m]. by_noise: the median of all if noise alone hid them [m].
        hidden: columns of candidates that new coefficients absorb.
        absorbed: causes that explain the log as well as new coefficients do: effects, or
            :data:`GRADE_BIAS`; each with a test that distinguishes it from them, as a sentence.
    """

    visible: Mapping[str, float]
    by_noise: float
    hidden: frozenset[int]
    absorbed: Mapping[str, str]


def resolvable(fit: Fit, at: int, book: Dictionary) -> Resolvable:
    """Effects that the log could have shown."""
    named = [c for c in book.candidates if c.named]
    log = _Normal(fit, at, book.columns.take([c.first for c in named]))
    share, sizes, sizes_by_noise = log.seen()
    visible: dict[str, float] = {}
    by_noise: list[float] = []
    never_seen = set()
    for name in dict.fromkeys(c.name for c in named):
        group = [i for i, c in enumerate(named) if c.name == name]
        # Place of a surface and direction of a wind are arbitrary: the middle of the grid.
        visible[name] = float(np.median(sizes[group]))
        by_noise.append(float(np.median(sizes_by_noise[group])))
        if share[group].min() >= _ABSORBED:
            never_seen.add(name)
    stops = len(fit.trace.table)
    limit = log.base_chi_square() + float(chi2.isf(prior.RULED_OUT, 4)) * stops / max(stops - 5, 1)
    causes: dict[str, str] = {}
    if log.cause_chi_square(len(named), _BIAS)[0] < limit:
        causes[GRADE_BIAS] = _BIAS_TEST
    for i, c in enumerate(named):
        if c.name in never_seen:
            chi_square, strength = log.cause_chi_square(i)
            if chi_square < limit and (strength > 0.0 or not c.one_sided):
                causes.setdefault(c.name, LAWS[c.name].experiment)
    hidden = frozenset(named[i].first for i in np.flatnonzero(share >= _ABSORBED))
    return Resolvable(visible, float(np.median(by_noise or [0.0])), hidden, causes)


class _Normal:
    """Normal equations of nuisances (first), candidates with a bias of all grades, and residuals.

    The residuals are beyond the dead time of the fit, and beyond that of the file.
    """

    def __init__(self, fit: Fit, at: int, named: Integrated) -> None:
        trace, onset = fit.trace, fit.onsets[at]
        table = trace.table
        bias = _bias(trace)
        shares = np.concatenate([named.shares, bias.shares], axis=2)
        through = np.append(named.through, bias.through)
        every, per_stop, std = columns_at(trace, onset, Integrated.of(table, shares, through))
        # Gravity and brakes have the same bias; candidates and it end before the residuals.
        every[:, :, -3] += every[:, :, -2]
        # A single cause leaves the dead time as configured.
        late = onset.dead_time + onset.build_up - trace.model.braking.dead_time
        every[:, :, -2] = every[:, :, -1] + late * every[:, :, 0]
        candidates = every[:, :, len(std) : -2]
        variance = prior.own_variance(fit.noise, per_stop.shape[2])
        weighed = Grams.of(every, per_stop, table.spread).whitened(fit.noise[0], variance)[0]
        last = np.append(np.arange(len(std)), [-1, -2])
        self.inner, self.cross = weighed[: len(std), last], weighed[len(std) : -2, last]
        self.sides = np.diag(weighed)[[-1, -2]]
        self.squares = np.diag(weighed)[len(std) : -2]
        self.std = with_onset(std, fit.noise)
        self.base = np.append(0, np.arange(len(std))[BASE_PLACES])
        self.std_of_others = self.std.copy()  # coefficients and dead time are free
        self.std_of_others[self.base] = np.inf
        span = (table.time[:, -1] - table.time[:, 0]) / (table.spread > 0.0).sum(axis=1)
        held = (table.spread > 0.0) * span[:, None]
        self.way = np.einsum("sk,skp->sp", held, every[:, :, self.base])
        self.candidates_way = np.einsum("sk,skq->sq", held, candidates[:, :, :-1])

    def seen(self) -> tuple[Floats, Floats, Floats]:
        """(Q,) share of each candidate's column that new coefficients absorb, and its sizes [m].

        A size is the change of stops, beyond what new coefficients can do, from which five logs
        of six would show it, in the stops that it changes most: given the small versions of effects
        that are always present, and given noise alone.
        """
        inner = self.inner[np.ix_(self.base, self.base)]
        cross, alone = self.cross[:-1, self.base].T, self.squares[:-1]
        taken = np.linalg.solve(inner + np.diag(1e-9 * np.diag(inner)), cross)
        left = np.maximum(alone - np.sum(cross * taken, axis=0), 0.0)
        change = np.abs(self.candidates_way - self.way @ taken)
        columns, precision = self.cross[:-1, : len(self.std)].T, 1.0 / self.std_of_others**2
        inner = self.inner[:, : len(self.std)] + np.diag(precision + 1e-9 * np.diag(self.inner))
        beyond = alone - np.sum(columns * np.linalg.solve(inner, columns), axis=0)
        known = np.where(left > ROUNDING * alone, [np.maximum(beyond, 1e-300), left], np.nan)
        size = np.sort(change, axis=0)[-CHANGED_STOPS] * (np.sqrt(NAMED_FROM) + 1.0)
        absorbed = np.asarray(1.0 - left / np.maximum(alone, 1e-300), np.float64)
        always, by_noise = np.nan_to_num(size / np.sqrt(known), nan=np.inf)
        return absorbed, always, by_noise

    def base_chi_square(self) -> float:
        """With free coefficients and dead time."""
        inner, pull = self.inner[:, : len(self.std)], self.inner[:, -2]
        return float(self.sides[0] - _fitted(inner, self.std_of_others, pull)[0])

    def cause_chi_square(self, candidate: int, std: float = np.inf) -> tuple[float, float]:
        """As configured with a candidate, or the bias after them, of that prior; its strength."""
        rest = np.setdiff1d(np.arange(len(self.std)), self.base)
        cross = self.cross[candidate, rest][:, None]
        inner = np.block(
            [[self.inner[np.ix_(rest, rest)], cross], [cross.T, self.squares[candidate]]]
        )
        pull = np.append(self.inner[rest, -1], self.cross[candidate, -1])
        taken, mean = _fitted(inner, np.append(self.std[rest], std), pull)
        return float(self.sides[1] - taken), mean


def _fitted(inner: Floats, std: Floats, pull: Floats) -> tuple[float, float]:
    """Chi square that columns (P,) take, and mean of the last one."""
    mean = np.linalg.solve(inner + np.diag(1.0 / std**2), pull)
    return float(pull @ mean), float(mean[-1])


def _bias(trace: Trace) -> Integrated:
    """(…, 2) change of gravity and of the force of the brakes by an angle of all grades."""
    table, configured, step = trace.table, Hypothesis.configured(trace.model), 1e-3
    moved = replace(table, grade=table.grade + step)
    force = demanded_force(table, configured, moved) - demanded_force(table, configured, table)
    shares = np.stack([np.cos(table.grade), force / step], axis=2)
    return Integrated.of(table, shares, np.array([False, True]))
