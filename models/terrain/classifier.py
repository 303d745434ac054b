"""Which class of terrain an observation comes from, with probabilities, and "none of these".

Each class predicts each feature by a Student t distribution: what a normal distribution says of the
next value after so many. Features are taken as independent within a class. A feature that is not
known says nothing. Source: Slip, Sec. 4.2 asks for it; standard Bayesian inference.

Two more explanations compete: a gross error in one feature, which costs probability but leaves the
others to decide, and ground of no known class, which may be anywhere. So one absurd reading does
not turn asphalt into something unheard of, and strange ground is not forced into a class.

Validity: the vehicle that the classes were learned with. Omits: that features of one ground vary
together, for lack of data to learn it from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from slopewise.models.arrays import Floats
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClasses, deciding

NONE = "none of these"

Values = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassifierSettings:
    """How much is held possible beside the known classes."""

    gross_error: float = quantity(
        "1", "Probability that a feature is grossly wrong.", default=0.02, above=0.0, at_most=0.5
    )
    unknown_ground: float = quantity(
        "1", "Probability of ground of no known class.", default=0.02, above=0.0, at_most=0.5
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


@dataclass(frozen=True, slots=True)
class Classification:
    """Probabilities of the classes and of none of them; they sum to 1.

    Attributes:
        name: the most probable, may be :data:`NONE`; empty if nothing was known.
        probability: its own.
        probabilities: of all, by name.
        doubtful: some feature is more likely a gross error than what this class gives.
    """

    name: str
    probability: float
    probabilities: dict[str, float]
    doubtful: bool = False


class TerrainClassifier:
    """Naive Bayes with Student t predictions; immutable."""

    def __init__(self, classes: TerrainClasses, settings: ClassifierSettings | None = None) -> None:
        """Prepare.

        Args:
            classes: what is known. Without any every observation is none of these.
            settings: of the classifier.
        """
        self.classes = classes
        self._settings = ClassifierSettings() if settings is None else settings
        self._names = [one.name for one in classes.terrain]
        self._decide = any(
            feature is not None and feature.decides
            for one in classes.terrain
            for feature in one.features
        )
        table = np.array([[_numbers(f) for f in one.features] for one in classes.terrain])
        self._mean, self._spread, self._freedom = np.moveaxis(table.reshape(-1, 3, 3), 2, 0)
        self._centre, self._width = np.array(
            [_anywhere(table[:, i] if len(table) else table.reshape(0, 3)) for i in range(3)]
        ).T

    def classify(self, values: Values, stds: Values = (0.0, 0.0, 0.0)) -> Classification:
        """Class of one observation.

        Args:
            values: (f_r, μ_t, B_s), NaN where not known.
            stds: of the values. A class's spread holds the usual error of measurement; only a
                larger one counts, in its place.
        """
        table = self.probabilities(np.array([values]), np.array([stds]))[0]
        names = [*self._names, NONE]
        found = dict(zip(names, table.tolist(), strict=True))
        if not np.isfinite(values).any():
            return Classification("", math.nan, found)
        best = max(found, key=lambda name: found[name])
        doubtful = False
        if best != NONE:
            row = self._names.index(best)
            predicted, anywhere = self._densities(np.array([values]), np.array([stds]))
            wrong = self._settings.gross_error
            off = (1.0 - wrong) * predicted[0, row] < wrong * anywhere[0]
            doubtful = bool(np.any(off & np.isfinite(values) & np.isfinite(self._mean[row])))
        return Classification(best, found[best], found, doubtful)

    def probabilities(self, values: Floats, stds: Floats) -> Floats:
        """(n, classes + 1) probabilities of n observations; the last column is none of these.

        Args:
            values: (n, 3) features, NaN where not known.
            stds: (n, 3) standard deviations of them, as in :meth:`classify`.
        """
        s = self._settings
        predicted, anywhere = self._densities(values, stds)
        mixed = (1.0 - s.gross_error) * predicted + s.gross_error * anywhere[:, None, :]
        measured = np.isfinite(values)
        log = np.empty((len(values), len(self._names) + 1))
        log[:, :-1] = np.where(measured[:, None, :], np.log(mixed), 0.0).sum(axis=2)
        log[:, :-1] += math.log((1.0 - s.unknown_ground) / max(len(self._names), 1))
        log[:, -1] = np.where(measured, np.log(anywhere), 0.0).sum(axis=1)
        log[:, -1] += math.log(s.unknown_ground)
        if self._decide:
            self._rule_out(values, log)
        share = np.exp(log - log.max(axis=1, keepdims=True))
        return np.asarray(share / share.sum(axis=1, keepdims=True))

    def _rule_out(self, values: Floats, log: Floats) -> None:
        """Where a feature decides for one class, no other known class remains.

        Args:
            values: (n, 3). log: (n, classes + 1) log probabilities, changed.
        """
        for row, (f_r, mu_t, b_s) in enumerate(values.tolist()):
            found = deciding(self.classes, (f_r, mu_t, b_s))
            if len(found) == 1:
                others = [i for i, name in enumerate(self._names) if name != found[0]]
                log[row, others] = -np.inf

    def _densities(self, values: Floats, stds: Floats) -> tuple[Floats, Floats]:
        """(n, classes, 3) by class and (n, 3) anywhere; a class that lacks a feature: anywhere.

        The next value after n of a class: t with n − 1 degrees of freedom, scale s √(1 + 1/n).
        """
        x = np.nan_to_num(values, nan=0.0)
        anywhere = stats.cauchy.pdf(x, self._centre, self._width)
        error = np.nan_to_num(stds, nan=0.0, posinf=1e9)[:, None, :]
        spread = np.fmax(self._spread, error)
        predicted = stats.t.pdf(x[:, None, :], self._freedom, self._mean, spread)
        return np.where(np.isnan(self._mean), anywhere[:, None, :], predicted), anywhere


def _numbers(feature: FeatureOfClass | None) -> tuple[float, float, float]:
    """Mean, scale and degrees of freedom of what a class predicts; NaN where it does not."""
    if feature is None:
        return math.nan, math.nan, math.nan
    spread = feature.std * math.sqrt(1.0 + 1.0 / feature.samples)
    return feature.mean, spread, feature.samples - 1.0


def _anywhere(column: Floats) -> tuple[float, float]:
    """Centre and width of where any ground may lie: about the known classes, heavy tails.

    Args:
        column: (classes, 3) mean, scale and degrees of freedom of one feature.
    """
    known = column[np.isfinite(column[:, 0])]
    if not len(known):
        return 0.0, 1.0
    width = max(2.0 * float(np.std(known[:, 0])), 3.0 * float(np.max(known[:, 1])))
    return float(np.mean(known[:, 0])), width
