"""An explanation with the laws of its effects, where the linear likelihood left it.

Weights are of linear columns on grids; what is written has exact laws. Its numbers are fitted by
least squares of whitened speeds, so that noise and nuisances are those of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from slopewise.models.arrays import Bools, Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.place import Extent, settled
from slopewise.models.discrepancy.likelihood.trace import BASE_PLACES
from slopewise.models.discrepancy.likelihood.weigh import LAG, Explanation
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.model.hypothesis import (
    BASE,
    MAX_STEPS,
    Hypothesis,
    free_parameters,
)
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect

_STEP = 1e-3  # of derivatives, of a number's scale: rounding is a thousandth of it [1]
_BUILD_UP_SPREAD = 0.1  # of the build-up of brakes that have no lag, share of it [1]
_MAX_WIDENING = 2.0  # by which scattering stops widen an interval: more are no fault of noise [1]


class Known(NamedTuple):
    """Root of an information matrix (R, P) of free numbers, and (P,) their expected values."""

    root: Floats
    expected: Floats


@dataclass(frozen=True, slots=True)
class Refit:
    """A hypothesis at its best.

    Attributes:
        hypothesis: with its numbers. covariance: (P, P) of them, in the order of its `free`.
        whitener: covariance of the fit.
        known: prior of its numbers.
        extents: per added effect, deviations of numbers that have no derivative, by name.
        names: its effects in order of the alphabet, without the build-up of all brakes.
    """

    hypothesis: Hypothesis
    covariance: Floats
    whitener: Whitener
    known: Known
    extents: tuple[Extent, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def of_effects(self) -> list[Floats]:
        """(Q, Q) covariance of all parameters of each added effect; 0 of those that are given."""
        covariances, k = [], BASE
        for effect, extent in zip(self.hypothesis.added, self.extents, strict=True):
            free, names = free_parameters(effect), list(effect.parameters)
            rows, block = [names.index(name) for name in free], slice(k, k + len(free))
            covariance = np.zeros((len(names),) * 2)
            covariance[np.ix_(rows, rows)] = self.covariance[block, block]
            k = block.stop
            for name, std in extent.items():
                i = names.index(name)
                covariance[i, :] = covariance[:, i] = 0.0
                covariance[i, i] = std**2
            covariances.append(covariance)
        return covariances


def refitted(explanation: Explanation) -> Refit:
    """An explanation with the laws of its effects; causes without a name are omitted."""
    fit, at = explanation.fit, explanation.at
    model = fit.trace.model
    # Effects would absorb an unmodelled build-up; for coefficients alone it is a later onset.
    builds_up = bool(explanation.names) and all(e.name != LAG for e in model.effect)
    builds_up = builds_up or LAG in explanation.names
    whitener = Whitener.of(fit.trace, fit.onsets[at], fit.noise, lagging=builds_up)
    hypothesis, likely, extents = _linear(explanation, builds_up=builds_up)
    known = _known(explanation, hypothesis)
    best = improved(fit.trace.table, hypothesis, whitener, known)
    for i, inners in enumerate(likely):
        if len(inners) > 1:
            nearest = _nearest(fit.trace.table, best, i, inners)
            best = improved(fit.trace.table, nearest, whitener, known)
    return replace(best, extents=extents, names=tuple(sorted(explanation.names)))


def _known(explanation: Explanation, start: Hypothesis) -> Known:
    """Prior of coefficients as calibrated or changed, as is likelier, and of an unnamed build-up.

    A refit that knew less than the weights would be farther off on stops held out than they say.
    """
    fit = explanation.fit
    trace, held = fit.trace, fit.trace.table.held.mean()
    is_changed = fit.solutions[explanation.at].changed > 0.5
    std = prior.changed(trace.force) if is_changed else trace.calibrated
    count = len(start.free)
    root, expected = np.zeros((BASE + 1, count)), np.zeros(count)
    root[: BASE - 1, : BASE - 1] = prior.of_coefficients(held) / std[:, None]
    root[BASE - 1, BASE - 1] = 1.0  # [1/s] of the dead time: as good as unknown
    expected[BASE - 1] = start.model.braking.dead_time
    if LAG in start.names and LAG not in explanation.names:
        # Slip and dive at the onset, which a refit does not have, would pass for a build-up.
        expected[BASE] = fit.onsets[explanation.at].build_up
        root[BASE, BASE] = 1.0 / (_BUILD_UP_SPREAD * expected[BASE])
    return Known(root, expected)


def _linear(
    explanation: Explanation, *, builds_up: bool
) -> tuple[Hypothesis, list[list[dict[str, float]]], tuple[Extent, ...]]:
    """Its numbers as the linear likelihood has them; per effect, likely inner ones and extents."""
    fit, onset = explanation.fit, explanation.fit.onsets[explanation.at]
    mean = fit.solutions[explanation.at].mean
    of_shifts = prior.of_coefficients(fit.trace.table.held.mean())
    shift = np.asarray(np.linalg.solve(of_shifts, mean[BASE_PLACES]), np.float64)
    added: list[Effect] = []
    extents: list[Extent] = []
    likely: list[list[dict[str, float]]] = []
    dead_time = onset.dead_time
    if builds_up:
        added.append(Effect(name=LAG, parameters={"tau": onset.build_up}))
        extents.append({})
        likely.append([{}])
    else:
        dead_time += onset.build_up
    column = len(mean) - sum(c.count for c in fit.chosen)
    for candidate in fit.chosen:
        if candidate.named:
            inners, extent = settled(fit, explanation.at, candidate)
            coefficients = mean[column : column + candidate.count]
            added.append(effect_of(candidate.name, inners[0], coefficients))
            likely.append(inners)
            extents.append(extent)
        column += candidate.count
    start = Hypothesis(fit.trace.model, shift, max(dead_time, 0.0), tuple(added))
    return start, likely, tuple(extents)


def _nearest(
    table: StopTable, fit: Refit, index: int, inners: list[dict[str, float]]
) -> Hypothesis:
    """With the inner numbers of an effect that leave the smallest residual by its exact law."""
    added = fit.hypothesis.added
    effect = added[index]
    moved = [replace(effect, parameters={**effect.parameters, **inner}) for inner in inners]
    tried = [replace(fit.hypothesis, added=(*added[:index], e, *added[index + 1 :])) for e in moved]
    rows = fit.whitener.rows(np.stack([residual(table, h) for h in tried], axis=2))
    return tried[int(np.argmin(np.sum(rows**2, axis=0)))]


def effect_of(name: str, inner: dict[str, float], coefficients: Floats) -> Effect:
    """An effect by the coefficients of its columns, or the nearest that there can be.

    Args:
        name: an effect that logs are searched for. inner: its parameters next to the strength.
        coefficients: (Q,) of its columns [1].
    """
    how = LAWS[name].search
    assert how is not None
    if how.joint is not None:
        return Effect(name=name, parameters=how.joint(*coefficients.tolist()))
    strength: dict[str, float] = {}
    if not how.is_complete:
        low, high = LAWS[name].parameters[how.strength].bounds
        strength[how.strength] = min(max(how.offset + float(coefficients[0]), low), high)
    return Effect(name=name, parameters={**strength, **inner})


def residual(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, K) measured less predicted speed, up to the level of each stop [m/s]."""
    fall = np.einsum("skm,sm->sk", table.average, predict(table, hypothesis))
    left: Floats = np.where(table.spread > 0.0, table.binned - table.held[:, None] + fall, 0.0)
    return left


def jacobian(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, K, P) change of the fall of speed in bins with each free number."""
    free, steps = hypothesis.free, _STEP * hypothesis.scales
    steps = np.where(free + steps <= hypothesis.bounds[1], steps, -steps)
    here = predict(table, hypothesis)
    moved = [predict(table, hypothesis.moved(free + step)) - here for step in np.diag(steps)]
    return table.average @ (np.stack(moved, axis=2) / steps)


def improved(table: StopTable, start: Hypothesis, whitener: Whitener, known: Known) -> Refit:
    """Least squares within the bounds of all numbers, the coefficients drawn to those configured.

    Args:
        table: stops. start: from which to begin. whitener: that of these stops.
        known: prior of the numbers.
    """
    scales = start.scales
    low, high = (bound / scales for bound in start.bounds)

    def errors(x: Floats) -> Floats:
        rows = whitener.rows(residual(table, start.moved(x * scales))[:, :, None])[:, 0]
        return np.concatenate((rows, known.root @ (x * scales - known.expected)))

    def slopes(x: Floats) -> Floats:
        rows = whitener.rows(jacobian(table, start.moved(x * scales)))
        return np.concatenate((rows, known.root)) * scales

    inside = np.clip(start.free / scales, low + 1e-6, high - 1e-6)
    best = least_squares(
        errors, inside, slopes, bounds=(low, high), max_nfev=MAX_STEPS, xtol=1e-4, ftol=1e-6
    )
    covariance = np.linalg.pinv(best.jac.T @ best.jac, hermitian=True)
    # Numbers also absorb effects that are too small to be modelled.
    unmodelled = whitener.unmodelled()
    moved = covariance @ (best.jac[: len(unmodelled)].T @ unmodelled)
    # Few stops determine their scatter less than its likelihood pretends.
    covariance *= len(table) / max(len(table) - len(scales), 1) / prior.TEMPER
    covariance = _robust(covariance, best.jac, best.fun, whitener.root.shape[:2])
    covariance += moved @ moved.T
    scaled = scales[:, None] * covariance * scales
    covariance = 0.5 * (scaled + scaled.T)
    return Refit(start.moved(best.x * scales), covariance, whitener, known)


def without(fit: Refit, table: StopTable, stops: Bools) -> tuple[StopTable, Hypothesis]:
    """The held-out stops (S,), and the same numbers fitted to all others."""
    seen = table.take(~stops)
    again = improved(seen, fit.hypothesis, fit.whitener.take(~stops), fit.known)
    return table.take(stops), again.hypothesis


def _robust(covariance: Floats, x: Floats, r: Floats, shape: tuple[int, ...]) -> Floats:
    """Covariance, wider where stops scatter more along a number than the noise says.

    The sandwich of the scores of whole stops holds for any noise within a stop
    (White 1980, in clusters); with few stops it comes out too small, so it only ever widens.
    """
    count = int(np.prod(shape))
    scores = (x * r[:, None])[:count].reshape(*shape, -1).sum(axis=1)
    sandwich = covariance @ (scores.T @ scores) @ covariance
    variance = np.maximum(np.diag(covariance), 1e-300)
    wider = np.sqrt(np.clip(np.diag(sandwich) / variance, 1.0, _MAX_WIDENING**2))
    result: Floats = covariance * np.outer(wider, wider)
    return result
