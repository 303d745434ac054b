"""Kinds of ground told from signatures, and whether a signature is of any kind known.

Two pictures of the same training runs. The linear discriminant says which class; its scores, made
probabilities by one temperature, are linear in the features and can be read. How strange a
signature is, is asked of both pictures: of the discriminant's own distance to the nearest class,
and of a normal distribution about each class after the effect of driving is taken out, with every
run counting alike and with more doubt where a class was driven in few runs. Features that were not
measured are left out of the second and are the mean in the first.

Source: linear discriminant analysis and Mahalanobis distance, standard; temperature scaling, Guo
and others (2017). Validity: the vehicle, its tyres and sensors, and ways of driving that the
training runs hold. Omits: that classes scatter differently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.terrain.signature import Signature

_SURE_OF_NOTHING = 1e-9
"""Keeps the logarithm of a probability of zero finite [1]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearPicture:
    """The discriminant over q inputs: the features, then the driving.

    Attributes:
        fill: (q,) what stands for a missing input. scale: (q,) inputs are divided by it after the
            fill was taken off.
        weights: (classes, q). intercept: (classes,). means: (classes, q) of the scaled inputs.
        precision: (q, q) inverse of the scatter within classes.
    """

    fill: Floats
    scale: Floats
    weights: Floats
    intercept: Floats
    means: Floats
    precision: Floats

    def scores(self, inputs: Floats) -> tuple[Floats, float]:
        """(classes,) scores of (q,) inputs, and squared distance per input to the nearest class."""
        x = np.where(np.isfinite(inputs), inputs - self.fill, 0.0) / self.scale
        off = x - self.means
        distance = np.einsum("ci,ij,cj->c", off, self.precision, off)
        return self.weights @ x + self.intercept, float(distance.min()) / len(x)


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalPicture:
    """A normal distribution about each class, over f features.

    Attributes:
        mean: (classes, f) at the usual driving. slopes: (driving, f) what driving changes.
        usual: (driving,) driving of the means. spread: (f,) within classes.
        correlation: (f, f) of the features within classes.
        doubt: (classes, f) variance of the means themselves, in spreads squared.
    """

    mean: Floats
    slopes: Floats
    usual: Floats
    spread: Floats
    correlation: Floats
    doubt: Floats

    def distance(self, features: Floats, driving: Floats) -> float:
        """Squared distance per measured feature to the nearest class; NaN if none is measured."""
        measured = np.flatnonzero(np.isfinite(features))
        if not len(measured):
            return math.nan
        here = features - (driving - self.usual) @ self.slopes
        off = (here - self.mean)[:, measured] / self.spread[measured]
        shared = self.correlation[np.ix_(measured, measured)]
        covariances = shared + self.doubt[:, measured, None] * np.eye(len(measured))
        solved = np.linalg.solve(covariances, off[:, :, None])[..., 0]
        return float(np.einsum("ci,ci->c", off, solved).min()) / len(measured)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignatureModel:
    """What training runs taught; made by :func:`slopewise.models.terrain.signature_fit.fit`.

    Attributes:
        classes: names. runs: training runs of each. used: (48,) features that take part.
        linear, normal: the two pictures.
        temperature: scores are multiplied by it.
        centre, width: (2,) of the logarithms of both distances on left-out runs.
        threshold: strangeness beyond which ground is none of these.
        known_refused: share of signatures of known classes, of runs left out in training, that are
            beyond the threshold.
    """

    classes: tuple[str, ...]
    runs: tuple[int, ...]
    used: Bools
    linear: LinearPicture
    normal: NormalPicture
    temperature: float
    centre: Floats
    width: Floats
    threshold: float
    known_refused: float

    def probable(self, signature: Signature) -> Floats:
        """(classes,) log probabilities given that it is one of them."""
        features = signature.features[self.used]
        scores, _ = self.linear.scores(np.concatenate([features, signature.driving]))
        return log_probabilities(self.temperature * scores)

    def look(self, signature: Signature) -> tuple[Floats, float]:
        """(classes,) log probabilities given that it is one of them, and strangeness.

        Strangeness is 0 in the middle of known ground and NaN where nothing was measured.
        """
        features = signature.features[self.used]
        scores, linear = self.linear.scores(np.concatenate([features, signature.driving]))
        normal = self.normal.distance(features, signature.driving)
        return log_probabilities(self.temperature * scores), self.strangeness(linear, normal)

    def strangeness(self, linear: float, normal: float) -> float:
        """Both distances on the scale of left-out runs, together [1]."""
        logs = np.log(np.array([linear, normal]) + _SURE_OF_NOTHING)
        return float(np.sum((logs - self.centre) / self.width))


def log_probabilities(scores: Floats) -> Floats:
    """(…, classes) logarithms of the softmax of scores over the last axis."""
    shifted = scores - scores.max(axis=-1, keepdims=True)
    return np.asarray(shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True)))
