"""Effects that a log could have shown, and those that new coefficients hide.

An effect whose share of the force is the same in all stops, up to what the coefficients can do, is
absorbed by them; so is a pitch sensor that is mounted askew. Where the model as configured with a
single such cause explains the log as well as new coefficients, the log cannot distinguish them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from slopewise.models.arrays import Floats, Ints
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Dictionary
from slopewise.models.discrepancy.likelihood.fit import Fit
from slopewise.models.discrepancy.likelihood.gaussian import Grams
from slopewise.models.discrepancy.likelihood.marginal import waves_of, with_onset
from slopewise.models.discrepancy.likelihood.onset import Integrated
from slopewise.models.discrepancy.likelihood.trace import BASE_PLACES, Trace, columns_at
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import demanded_force
from slopewise.models.effects.registry import LAWS

GRADE_BIAS = "grade_bias"
"""A pitch sensor or a map that is off by the same angle everywhere."""
CHANGED_STOPS = 3  # stops that an effect has to change to matter: two are outliers [1]
_NAMED_FROM = 12.0
"""Chi square from which a name outweighs none: odds of 0.08, and the width of its prior [1]."""
_MIN_COLUMN = 1e-4  # share of a candidate beyond the base below which rounding dominates [1]
_MAX_BIAS, _BIAS_STDS = np.deg2rad(2.5), 2.0
"""Error of all grades that is not obvious [rad], and standard deviations of it to allow for [1]."""
_ABSORBED = 0.98  # share of a column that the base absorbs, from which it hides it [1]
_P_ABSORBED = 0.05  # p-value from which a single cause is as good as new coefficients [1]
_BIAS_TEST = (
    "stand still on ground of known slope, or drive the same slope both ways, and read the pitch; "
    "or coast: without brakes a wrong grade shows and brakes do not"
)


@dataclass(frozen=True, slots=True)
class Absorbed:
    """A cause that new coefficients would hide.

    Attributes:
        name: effect, or :data:`GRADE_BIAS`.
        test: test that distinguishes it from new coefficients, as a sentence.
    """

    name: str
    test: str


@dataclass(frozen=True, slots=True)
class Resolvable:
    """Of each effect, by name.

    Attributes:
        visible: change of a stop, beyond new coefficients, from which five logs of six like this
            one name it [m]. hidden: names of those that new coefficients absorb.
        absorbed: causes that explain the log as well as new coefficients do.
    """

    visible: Mapping[str, float]
    hidden: frozenset[str]
    absorbed: tuple[Absorbed, ...]


def resolvable(fit: Fit, at: int, book: Dictionary) -> Resolvable:
    """Effects that the log could have shown."""
    named = [c for c in book.candidates if c.named]
    log = _Normal(fit, at, book.columns.take([c.first for c in named]))
    share, sizes = log.absorbed(), log.visible()
    visible: dict[str, float] = {}
    hidden = set()
    for name in dict.fromkeys(c.name for c in named):
        group = [i for i, c in enumerate(named) if c.name == name]
        # Place of a surface and direction of a wind are arbitrary: the middle of the grid.
        visible[name] = float(np.median(sizes[group]))
        if share[group].min() >= _ABSORBED:
            hidden.add(name)
    stops = len(fit.trace.table)
    limit = log.base_chi_square() + float(chi2.isf(_P_ABSORBED, 4)) * stops / max(stops - 5, 1)
    causes = {}
    chi_square, bias, std = log.cause_chi_square(len(named))
    if chi_square < limit and abs(bias) - _BIAS_STDS * std <= _MAX_BIAS:
        causes[GRADE_BIAS] = _BIAS_TEST
    for i, c in enumerate(named):
        if c.name in hidden:
            chi_square, strength, _ = log.cause_chi_square(i)
            able = strength > 0.0 or not c.one_sided
            if able and chi_square < limit:
                causes.setdefault(c.name, LAWS[c.name].experiment)
    return Resolvable(visible, frozenset(hidden), tuple(map(Absorbed, causes, causes.values())))


class _Normal:
    """Normal equations of nuisances (first), candidates, a bias of all grades, and residuals."""

    def __init__(self, fit: Fit, at: int, named: Integrated) -> None:
        trace, onset = fit.trace, fit.onsets[at]
        table = trace.table
        bias = _bias(trace)
        shares = np.concatenate([named.shares, bias.shares], axis=2)
        through = np.append(named.through, bias.through)
        every, own, std = columns_at(trace, onset, Integrated.of(table, shares, through))
        # Gravity and brakes have the same bias.
        every[:, :, -3] += every[:, :, -2]
        every = np.delete(every, -2, axis=2)
        # A single cause leaves the dead time as configured.
        late = onset.dead_time + onset.build_up - trace.model.braking.dead_time
        dead = every[:, :, -1] + late * every[:, :, 0]
        grams = Grams.of(np.append(every, dead[:, :, None], axis=2), own, table.spread)
        variance = prior.own_variance(fit.noise, waves_of(grams))
        self.products, _ = grams.weighed(fit.noise[0], variance)
        self.std = with_onset(std, fit.noise)
        self.base = np.append(0, np.arange(len(std))[BASE_PLACES])
        self.candidates = np.arange(len(std), every.shape[2] - 2)
        span = (table.time[:, -1] - table.time[:, 0]) / (table.spread > 0.0).sum(axis=1)
        self.way = (every * (table.spread > 0.0)[:, :, None]).sum(axis=1) * span[:, None]

    def _taken(self) -> tuple[Floats, Floats, Floats]:
        """(5, Q) of the base in candidates, (Q,) information about these, and without the base."""
        inner = self.products[np.ix_(self.base, self.base)]
        cross = self.products[np.ix_(self.base, self.candidates)]
        taken = np.linalg.solve(inner + np.diag(1e-9 * np.diag(inner)), cross)
        own = np.diag(self.products)[self.candidates]
        return taken, np.maximum(own - np.sum(cross * taken, axis=0), 0.0), own

    def absorbed(self) -> Floats:
        """(Q,) share of each candidate's column that new coefficients absorb."""
        _, left, own = self._taken()
        return np.asarray(1.0 - left / np.maximum(own, 1e-300), np.float64)

    def visible(self) -> Floats:
        """(Q,) change of stops from which each candidate would have been seen [m].

        Beyond what new coefficients can do, so large that five logs of six would show it, in the
        stops that it changes most.
        """
        taken, left, own = self._taken()
        change = self.way[:, self.candidates] - self.way[:, self.base] @ taken
        left = np.where(left > _MIN_COLUMN * own, left, np.nan)
        size = np.sort(np.abs(change), axis=0)[-CHANGED_STOPS]
        size *= (np.sqrt(_NAMED_FROM) + 1.0) / np.sqrt(left)
        return np.where(np.isfinite(size), size, np.inf)

    def base_chi_square(self) -> float:
        """With free coefficients and dead time."""
        std = self.std.copy()
        std[self.base] = np.inf
        return self._chi_square(np.arange(len(std)), std, -2)[0]

    def cause_chi_square(self, candidate: int) -> tuple[float, float, float]:
        """As configured with a candidate, or the bias after them; its strength, and the std."""
        rest = np.setdiff1d(np.arange(len(self.std)), self.base)
        std = np.append(self.std[rest], np.inf)
        return self._chi_square(np.append(rest, len(self.std) + candidate), std, -1)

    def _chi_square(self, columns: Ints, std: Floats, side: int) -> tuple[float, float, float]:
        """That columns leave of what stands at a side; mean and std of the last one."""
        inner = self.products[np.ix_(columns, columns)] + np.diag(1.0 / std**2)
        pull = self.products[columns, side]
        last = np.zeros(len(columns))
        last[-1] = 1.0
        mean, unit = np.linalg.solve(inner, np.column_stack((pull, last))).T
        left = float(self.products[side, side] - pull @ mean)
        return left, float(mean[-1]), float(np.sqrt(unit[-1]))


def _bias(trace: Trace) -> Integrated:
    """(…, 2) change of gravity and of the force of the brakes by an angle of all grades."""
    table, configured = trace.table, Hypothesis.configured(trace.model)
    place, step = table.ground, 1e-3
    moved = place._replace(grade=place.grade + step)
    force = demanded_force(table, configured, moved) - demanded_force(table, configured, place)
    shares = np.stack([np.cos(place.grade), force / step], axis=2)
    return Integrated.of(table, shares, np.array([False, True]))
