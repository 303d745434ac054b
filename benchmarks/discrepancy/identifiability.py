"""Identifiability of a hidden effect: its expected χ² in a set, found without the workflow.

The plant itself is fitted to the truth: base coefficients and dead time to noise-free stops
(Gauss–Newton on finite differences of the plant), then the base with each alternative effect. The
residual, weighted with the noise of the speed and the scatter from stop to stop, is the expected χ²
by which truth and alternative differ. Where it is small no method can name the effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular, toeplitz

from .effect_plant import drive, speeds
from .hidden_effects import FIELDS, FREE, NOT_NEGATIVE, ONE_SIGN, Doses, amplified, small_doses
from .plant_physics import Floats, Physics, Stops
from .sensing import CORRELATED, MEMORY, QUANTUM, RATE

DETECTABLE_CHI2 = 30.0
"""Expected χ² from which an effect can be detected: in 19 of 20 sets it then exceeds the largest
chance effect of a whole library (about 13)."""

DISTINCT_CHI2 = 20.0  # Expected χ² to the nearest alternative from which the name can be given
_BASE = {"m_m": 1e-3, "b_m": 1e-3, "m_b": 1e-4, "b_b": 1e-4, "dead_time": 1e-3}
"""Steps of the finite differences [SI]."""

_STEP = 0.01  # [s] of the integration; its error cancels in differences
_JITTER = 0.008  # [s] of the onset, with the phase of the sampling
_MAX_STOP = 9.0  # [s]
_ONSET_SAMPLES = 20.0  # averaged to the speed at the command
_MIN_SPEED = 0.15  # [m/s]; below it the encoder's steps dominate
_EVALUATED = 40  # stops at most, spread evenly; they stand for the others
_FITTED_ALTERNATIVES = 2  # nearest ones, fitted beyond their small dose


@dataclass(frozen=True, slots=True)
class Identifiability:
    """Expected χ² of a set."""

    gap: float  # truth against the refitted base
    apart: float  # words: ok (truth against the best alternative, refitted)

    @property
    def is_detectable(self) -> bool:
        return self.gap >= DETECTABLE_CHI2

    @property
    def has_name(self) -> bool:
        """Whether the effect can be detected and distinguished from all others."""
        return self.is_detectable and self.apart >= DISTINCT_CHI2


NOT_IDENTIFIABLE = Identifiability(0.0, 0.0)
"""Of a set whose effect changes no stop: χ² of 0, no alternative."""


def identifiability(
    truth: Physics, base: Physics, stops: Stops, noise: float, scatter: float, hidden: Iterable[str]
) -> Identifiability:
    """Expected χ² of one set, between the truth and the world without these hidden effects.

    A single effect is no alternative to itself, of two each is. Friction and delay of the stops are
    ignored; noise and scatter are standard deviations of sensing and design.
    """
    names = tuple(hidden)
    calm = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    fit = WeightedStops(truth, calm, noise, scatter)
    fitted, residual = fit.refit(base)
    gap = float(residual @ residual)
    if gap < DETECTABLE_CHI2:
        return Identifiability(gap, 0.0)
    if len(names) == 1:
        return Identifiability(gap, _nearest(fit, fitted, residual, {}, names))
    # Of several, each may be alone, or be accompanied by a wrong one.
    apart = gap
    for name in names:
        start = fitted._replace(**{key: getattr(truth, key) for key in FIELDS[name].values()})
        alone, left = fit.refit(start, FREE[name])
        accompanied = _nearest(fit, alone, left, FREE[name], names)
        apart = min(apart, float(left @ left), accompanied)
    return Identifiability(gap, apart)


def _nearest(
    fit: WeightedStops,
    fitted: Physics,
    residual: Floats,
    free: Mapping[str, float],
    names: Sequence[str],
) -> float:
    """χ² that the nearest alternative leaves, in addition to the fitted effects."""
    tangents = fit.tangents(fitted, _BASE | dict(free))
    alternatives = []
    doses = small_doses(fitted, fit.stops)
    for name, options in fit.columns(fitted, doses).items():
        if name in names:
            continue
        left, number, factor = _project(residual, tangents, options, one_sign=name in ONE_SIGN)
        start = None if number < 0 else amplified(name, doses[name][number], factor)
        alternatives.append((left, name, start))
    alternatives.sort(key=lambda alternative: alternative[0])
    smallest = alternatives[0][0]
    # Doses are small and effects are not: the nearest ones are fitted.
    for _, name, start in alternatives[:_FITTED_ALTERNATIVES]:
        if start is not None:
            unexplained = fit.refit(fitted._replace(**start), FREE[name] | dict(free))[1]
            smallest = min(smallest, float(unexplained @ unexplained))
    return smallest


class WeightedStops:
    """Stops of the truth, and the weights of differences from them."""

    def __init__(self, truth: Physics, stops: Stops, noise: float, scatter: float) -> None:
        self.stops = stops
        rest = drive(truth, stops, np.zeros(1), _STEP).rest
        end = min(float(np.max(rest, where=np.isfinite(rest), initial=1.0)), _MAX_STOP)
        self.time = np.arange(0, round(end * RATE)) / RATE
        self.measured = speeds(truth, stops, self.time, _STEP)
        rolling = self.measured > _MIN_SPEED
        eps = 1e-3
        by_friction = self.speed(truth, friction=stops.friction + eps) / eps
        by_delay = self.speed(truth, delay=stops.delay + eps) / eps
        by_speed = self.speed(truth, speed=stops.speed + eps) / eps
        random = np.stack(
            [scatter * by_friction, _JITTER * by_delay, noise / np.sqrt(_ONSET_SAMPLES) * by_speed]
        )
        lags = np.exp(-self.time / MEMORY) * CORRELATED * noise**2
        lags[0] = noise**2 + QUANTUM**2 / 12.0
        covariance = toeplitz(lags)
        self.roots = []
        count = len(stops.speed)
        evaluated = np.unique(np.linspace(0, count - 1, min(_EVALUATED, count)).astype(int))
        self._each = float(np.sqrt(count / len(evaluated)))
        for i in evaluated:
            w = np.flatnonzero(rolling[i])
            u = random[:, i, w]
            self.roots.append((i, w, np.linalg.cholesky(covariance[np.ix_(w, w)] + u.T @ u)))

    def speed(self, physics: Physics, **changed: Floats) -> Floats:
        """Difference of a world's speeds from the measured ones, shape (n, samples) [m/s]."""
        stops = self.stops._replace(**changed)
        return speeds(physics, stops, self.time, _STEP) - self.measured

    def whiten(self, *differences: Floats) -> Floats:
        """Weighted differences, shape (k, all samples)."""
        stacked = np.stack(differences)
        parts = [
            solve_triangular(root, stacked[:, i, w].T, lower=True, check_finite=False)
            for i, w, root in self.roots
        ]
        weighted: Floats = self._each * np.concatenate(parts).T
        return weighted

    def tangents(self, physics: Physics, steps: Mapping[str, float] | None = None) -> Floats:
        """Whitened derivatives by the base's coefficients and dead time, or by other fields."""
        here = self.speed(physics)
        return self.whiten(
            *(
                (self.speed(physics._replace(**{key: getattr(physics, key) + eps})) - here) / eps
                for key, eps in (steps or _BASE).items()
            )
        )

    def columns(self, physics: Physics, doses: Doses) -> dict[str, list[Floats]]:
        """Options of each effect: one or two whitened columns, shape (k, all samples) each."""
        here = self.speed(physics)
        return {
            name: [
                self.whiten(*(self.speed(physics._replace(**fields)) - here for fields in together))
                for together in options
            ]
            for name, options in doses.items()
        }

    def refit(
        self, start: Physics, free: Mapping[str, float] | None = None
    ) -> tuple[Physics, Floats]:
        """Fit the base, and further fields with their steps, to the truth; with its residual."""
        steps = _BASE | dict(free or {})
        physics = start
        best = self.whiten(-self.speed(physics))[0]
        for _ in range(8):
            step, *_ = np.linalg.lstsq(self.tangents(physics, steps).T, best, rcond=None)
            for share in (1.0, 0.3):
                changed = {
                    k: getattr(physics, k) + share * d for k, d in zip(steps, step, strict=True)
                }
                if any(changed.get(k, 0.0) < 0.0 for k in NOT_NEGATIVE):
                    continue
                trial = physics._replace(**changed)
                left = self.whiten(-self.speed(trial))[0]
                if left @ left < best @ best:
                    physics, best = trial, left
                    break
            else:
                break
        return physics, best


def _project(
    residual: Floats, tangents: Floats, options: Sequence[Floats], *, one_sign: bool
) -> tuple[float, int, Floats]:
    """Smallest χ² over the options of an alternative, with its number and factor."""
    q = np.linalg.qr(tangents.T)[0]
    target = residual - q @ (q.T @ residual)
    best = (float(target @ target), -1, np.zeros(1))
    for number, columns in enumerate(options):
        free = columns.T - q @ (q.T @ columns.T)
        solution, *_ = np.linalg.lstsq(free, target, rcond=None)
        left = target - free @ solution
        if not (one_sign and np.any(solution < 0.0)) and left @ left < best[0]:
            best = (float(left @ left), number, np.asarray(solution, np.float64))
    return best
