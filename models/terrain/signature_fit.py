"""Signature models from labelled runs, with probabilities and the unknown tested on runs left out.

Runs are the unit: signatures of one run are alike, so that anything tested on the run it was
learned from flatters itself. Training runs are dealt into folds; temperature, the scale of
strangeness and its threshold come from the folds left out. The discriminant is scikit-learn's, an
extra loaded when something is fitted; a fitted model needs only NumPy.

Source: scikit-learn, LinearDiscriminantAnalysis with shrinkage; ridge regression for the effect of
driving; a class's mean as in a random-effects model, wider with few runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.signature import Signature
from slopewise.models.terrain.signature_model import (
    LinearPicture,
    NormalPicture,
    SignatureModel,
    log_probabilities,
)

_MEASURED = 8  # values that make a feature worth using
_LEAST_EIGENVALUE = 0.02  # of the correlation, so that copies among features do no harm
_FOLDS = 8
"""Parts of the cross-validation [1]."""
_FEW_RUNS = 4  # of each class: what differs from run to run shows in no fewer


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """How a signature model is fitted."""

    shrinkage: float = quantity(
        "1", "Of the discriminant's covariance.", default=0.1, at_least=0.0, at_most=1.0
    )
    correlation_shrinkage: float = quantity(
        "1", "Of the correlation within classes.", default=0.3, at_least=0.0, at_most=1.0
    )
    between_classes: float = quantity(
        "1", "Spread between classes, in spreads within them, before data.", default=1.5, above=0.0
    )
    known_refused: float = quantity(
        "1",
        "Share of known ground that may be called none of these.",
        default=0.05,
        above=0.0,
        at_most=0.5,
    )
    latest: float = quantity(
        "1", "Signatures that strangeness is averaged over.", default=6.0, at_least=1.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


class _TrainingRows(NamedTuple):
    """Training data: (n, features), (n, driving), (n,) class and (n,) run as numbers."""

    features: Floats
    driving: Floats
    label: Ints
    run: Ints

    def where(self, chosen: Bools) -> _TrainingRows:
        return _TrainingRows(
            self.features[chosen], self.driving[chosen], self.label[chosen], self.run[chosen]
        )


def fit(
    signatures: Sequence[Signature],
    labels: Sequence[str],
    runs: Sequence[str],
    settings: FitSettings | None = None,
) -> SignatureModel:
    """A model of labelled signatures.

    Args:
        signatures: in the order they were driven within each run. labels: class of each.
        runs: name of the run of each.
        settings: of the fit.

    Raises:
        ParameterError: fewer than two classes, a class with fewer than four runs, or scikit-learn
            is not installed.
    """
    settings = FitSettings() if settings is None else settings
    classes, label = np.unique(np.array(labels), return_inverse=True)
    run = np.unique(np.array(runs), return_inverse=True)[1]
    counts = [len(np.unique(run[label == c])) for c in range(len(classes))]
    if len(classes) < 2 or min(counts) < _FEW_RUNS:
        raise ParameterError(
            "terrain",
            f"two classes at least, each in {_FEW_RUNS} runs or more, got "
            + ", ".join(f"{name} in {n}" for name, n in zip(classes, counts, strict=True)),
        )
    features = np.array([s.features for s in signatures])
    used = np.isfinite(features).sum(axis=0) >= _MEASURED
    rows = _TrainingRows(features[:, used], np.array([s.driving for s in signatures]), label, run)
    linear, normal = _pictures(rows, len(classes), settings)
    scores, distances = _left_out(rows, len(classes), settings)
    logs = np.log(distances + 1e-9)
    centre, width = np.median(logs, axis=0), np.std(logs, axis=0) + 1e-9
    strange = running_mean(((logs - centre) / width).sum(axis=1), run, int(settings.latest))
    threshold = float(np.quantile(strange, 1.0 - settings.known_refused))
    return SignatureModel(
        classes=tuple(str(name) for name in classes),
        runs=tuple(counts),
        used=used,
        linear=linear,
        normal=normal,
        temperature=_temperature(scores, label),
        centre=centre,
        width=width,
        threshold=threshold,
        known_refused=float(np.mean(strange > threshold)),
    )


def _left_out(rows: _TrainingRows, classes: int, settings: FitSettings) -> tuple[Floats, Floats]:
    """(n, classes) scores and (n, 2) distances of signatures whose runs took no part."""
    fold = np.zeros(len(rows.label), np.int64)
    for c in range(classes):  # runs of each class in turn, so that no fold lacks one
        for turn, run in enumerate(np.unique(rows.run[rows.label == c])):
            fold[rows.run == run] = (turn + 3 * c) % _FOLDS
    scores, distances = np.zeros((len(fold), classes)), np.zeros((len(fold), 2))
    for k in np.unique(fold):
        out = fold == k
        linear, normal = _pictures(rows.where(~out), classes, settings)
        for i in np.flatnonzero(out):
            inputs = np.concatenate([rows.features[i], rows.driving[i]])
            scores[i], distances[i, 0] = linear.scores(inputs)
            distances[i, 1] = normal.distance(rows.features[i], rows.driving[i])
    return scores, distances


def _pictures(
    rows: _TrainingRows, classes: int, settings: FitSettings
) -> tuple[LinearPicture, NormalPicture]:
    return _linear(rows, classes, settings.shrinkage), _normal(rows, classes, settings)


def _linear(rows: _TrainingRows, classes: int, shrinkage: float) -> LinearPicture:
    try:
        from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    except ImportError:
        raise ParameterError(
            "--learn", "scikit-learn for signatures, got none: pip install '.[learn]' in a clone"
        ) from None
    inputs = np.concatenate([rows.features, rows.driving], axis=1)
    measured = np.isfinite(inputs)
    count = np.fmax(measured.sum(axis=0), 1)
    fill = np.where(measured, inputs, 0.0).sum(axis=0) / count
    filled = np.where(measured, inputs - fill, 0.0)
    scale = filled.std(axis=0)
    scale[scale == 0.0] = 1.0
    x = filled / scale
    model = LinearDiscriminantAnalysis(
        solver="lsqr", shrinkage=shrinkage, priors=np.full(classes, 1.0 / classes)
    ).fit(x, rows.label)
    means = np.array([x[rows.label == c].mean(axis=0) for c in range(classes)])
    scatter = np.cov((x - means[rows.label]).T)
    scatter = (1.0 - shrinkage) * scatter + shrinkage * np.eye(len(scatter))
    weights, intercept = model.coef_, model.intercept_
    if classes == 2:  # scikit-learn then gives the second against the first
        weights, intercept = np.vstack([-weights, weights]) / 2, np.r_[-intercept, intercept] / 2
    return LinearPicture(
        fill=fill,
        scale=scale,
        weights=weights,
        intercept=intercept,
        means=means,
        precision=np.asarray(np.linalg.inv(scatter), np.float64),
    )


def _normal(rows: _TrainingRows, classes: int, settings: FitSettings) -> NormalPicture:
    weight = _weights(rows, classes)
    usual = np.average(rows.driving, axis=0, weights=weight)
    basis = np.hstack([np.eye(classes)[rows.label], rows.driving - usual])
    ridge = np.r_[np.full(classes, 0.5), np.full(rows.driving.shape[1], 1.0)]
    width = rows.features.shape[1]
    mean, doubt = np.zeros((classes, width)), np.zeros((classes, width))
    slopes = np.zeros((rows.driving.shape[1], width))
    left = np.full_like(rows.features, np.nan)
    spread = np.ones(width)
    for j in range(width):
        known = np.isfinite(rows.features[:, j])
        if not known.any():
            doubt[:, j] = settings.between_classes**2
            continue
        x, w, b = rows.features[known, j], weight[known], basis[known]
        middle = float(np.average(x, weights=w))
        found = np.linalg.solve(
            (b * w[:, None]).T @ b + np.diag(ridge), (b * w[:, None]).T @ (x - middle)
        )
        mean[:, j], slopes[:, j] = middle + found[:classes], found[classes:]
        left[known, j] = off = x - middle - b @ found
        variance = float(np.average(off**2, weights=w)) + 1e-12
        spread[j] = np.sqrt(variance)
        own = rows.run[known]
        between = float(np.var([off[own == r].mean() for r in np.unique(own)])) + 1e-9
        for c in range(classes):
            many = len(np.unique(own[rows.label[known] == c]))
            free = 1.0 / (settings.between_classes**2 * variance)
            doubt[c, j] = 1.0 / (free + many / between) / variance
    correlation = _correlation(left / spread, weight, settings.correlation_shrinkage)
    return NormalPicture(
        mean=mean, slopes=slopes, usual=usual, spread=spread, correlation=correlation, doubt=doubt
    )


def _weights(rows: _TrainingRows, classes: int) -> Floats:
    """(n,) classes count alike, and within them a run as the root of its signatures."""
    weight = 1.0 / np.sqrt(np.bincount(rows.run)[rows.run])
    for c in range(classes):
        own = rows.label == c
        weight[own] /= weight[own].sum()
    return np.asarray(weight * len(weight) / weight.sum())


def _correlation(left: Floats, weight: Floats, shrinkage: float) -> Floats:
    """(f, f) of what is left within classes, pairs that were measured together; shrunk."""
    known = np.isfinite(left)
    root = np.sqrt(weight)[:, None]
    values, there = np.where(known, left, 0.0) * root, known * root
    found = (values.T @ values) / np.fmax(there.T @ there, 1e-9)
    found = (1.0 - shrinkage) * found + shrinkage * np.eye(len(found))
    size, axes = np.linalg.eigh(found)
    return np.asarray((axes * np.fmax(size, _LEAST_EIGENVALUE)) @ axes.T)


def _temperature(scores: Floats, label: Ints) -> float:
    """The factor on the scores that makes left-out labels most likely."""
    rows = np.arange(len(label))
    factors = np.geomspace(0.05, 2.0, 40)
    likely = [log_probabilities(f * scores)[rows, label].mean() for f in factors]
    return float(factors[int(np.argmax(likely))])


def running_mean(values: Floats, run: Ints, latest: int) -> Floats:
    """(n,) mean over the latest values of the same run, up to and with each."""
    means = np.empty_like(values)
    for one in np.unique(run):
        own = np.flatnonzero(run == one)
        sums = np.concatenate([[0.0], np.cumsum(values[own])])
        first = np.fmax(np.arange(1, len(own) + 1) - latest, 0)
        means[own] = (sums[1:] - sums[first]) / (np.arange(1, len(own) + 1) - first)
    return means
