"""Fitting a hypothesis to all stops: Gauss and Newton in whitened residuals, bounds kept.

Generalised least squares: every stop has a friction of its own, see
:mod:`slopewise.models.discrepancy.model.noise`, so that stops count and not samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.discrepancy.data.stop_ground import ground_of
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.body_oscillation import (
    OSCILLATION,
    oscillation_columns,
    oscillation_size,
)
from slopewise.models.discrepancy.model.brakes import lag_of
from slopewise.models.discrepancy.model.hypothesis import (
    BASE,
    LAWFUL,
    NUISANCES,
    Hypothesis,
    free_parameters,
    is_placed,
)
from slopewise.models.discrepancy.model.noise import Noise, Whitener, estimate, whitener
from slopewise.models.discrepancy.model.prediction import (
    force_of,
    integral,
    predict,
    simulate,
    wanted_force,
)
from slopewise.models.discrepancy.search.candidates import is_cap
from slopewise.models.discrepancy.thresholds import (
    BUILD_UP_SEEN,
    DERIVATIVE_STEP,
    FIRST_BUILD_UP,
    FIT_BENT,
    FIT_DONE,
    FIT_PASSES,
    FIT_TRIES,
    LEAST_FORCE,
    MOST_WIDER,
    NOISE_PASSES,
    OSCILLATES,
    QUICK_BUILD_UP,
)
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect, Model


@dataclass(frozen=True, slots=True)
class Fit:
    """A hypothesis at its best.

    Attributes:
        hypothesis: with fitted numbers. covariance: (P, P) of them.
        jacobian: (S, M, P) change of the fall of speed with each number.
        white: that it was weighed with.
        deviance: −2 log likelihood, up to a constant of the log.
        each: (S,) share of every stop in it.
        between: (S,) residual along the friction of each stop, see :class:`Whitener`.
    """

    hypothesis: Hypothesis
    covariance: Floats
    jacobian: Floats
    white: Whitener
    deviance: float
    each: Floats
    between: Floats

    @property
    def noise(self) -> Noise:
        """That it was weighed with."""
        return self.white.noise


def residual(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, K) measured less predicted speed, up to the level of each stop [m/s]."""
    fall = _observed(table, hypothesis)
    used = table.spread > 0.0
    left = table.binned - np.einsum("skm,sm->sk", table.average, table.held[:, None] - fall)
    result: Floats = np.where(used, left, 0.0)
    return result


def jacobian(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, M, P) change of the fall of speed with each free number."""
    free, steps = hypothesis.free, _steps(hypothesis)
    base = _observed(table, hypothesis)
    columns = np.zeros((*table.time.shape, len(free)))
    if hypothesis.oscillates:
        columns[:, :, LAWFUL : LAWFUL + OSCILLATION] = oscillation_columns(
            table, hypothesis.dead_time, lag_of(hypothesis)
        )
    wanted, shares = _wanted_changes(table, hypothesis, steps)
    columns[:, :, wanted] = integral(table, hypothesis, shares, np.ones(len(wanted), np.bool_))
    for i in (LAWFUL - 1, *range(BASE, len(free))):
        if i not in wanted:
            moved = free.copy()
            moved[i] += steps[i]
            columns[:, :, i] = (_observed(table, hypothesis.moved(moved)) - base) / steps[i]
    return columns


def _steps(hypothesis: Hypothesis) -> Floats:
    """(P,) by which numbers are moved for their slopes, away from bounds."""
    steps = DERIVATIVE_STEP * hypothesis.scales
    _, high = hypothesis.bounds
    result: Floats = np.where(hypothesis.free + steps <= high, steps, -steps)
    return result


def _wanted_changes(
    table: StopTable, hypothesis: Hypothesis, steps: Floats
) -> tuple[list[int], Floats]:
    """Numbers that act through the wanted force, and (S, M, Q) its change with each of them."""
    place = ground_of(table)
    wanted = wanted_force(table, hypothesis, place)
    moved = [replace(hypothesis, shift=hypothesis.shift + one) for one in np.eye(LAWFUL - 1)]
    shares = [wanted_force(table, h, place) - wanted for h in moved]
    numbers = list(range(LAWFUL - 1))
    i = BASE
    for effect in hypothesis.added:
        own = free_parameters(effect)
        if hypothesis.slips and is_placed(effect):
            for j in range(i, i + len(own)):
                free = hypothesis.free
                free[j] += steps[j]
                there = wanted_force(table, hypothesis.moved(free), place)
                shares.append((there - wanted) / float(steps[j]))
                numbers.append(j)
        elif LAWS[effect.name].enters is Enters.GROUND:
            here = force_of(table, effect, place)
            for j, name in enumerate(own, start=i):
                values = {**effect.parameters, name: effect.parameters[name] + float(steps[j])}
                there = force_of(table, replace(effect, parameters=values), place)
                shares.append((there - here) / steps[j])
                numbers.append(j)
        i += len(own)
    return numbers, np.stack(shares, axis=2)


def _observed(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, M) fall of the speed that is read, with all nuisances."""
    fall = predict(table, hypothesis)
    if not hypothesis.oscillates:
        return fall
    curve = oscillation_columns(table, hypothesis.dead_time, lag_of(hypothesis))
    result: Floats = fall + curve @ hypothesis.oscillation
    return result


def prior_precision(hypothesis: Hypothesis) -> Floats:
    """(P,) of the base's shifts: wide beside what a few dozen stops tell."""
    own = np.zeros(len(hypothesis.free))
    own[:4] = 1.0 / np.square(WEAK_PRIOR)
    own[4] = 1.0
    own[LAWFUL:BASE] = 1.0 / oscillation_size(lag_of(hypothesis)) ** 2
    return own


def fit(
    table: StopTable,
    hypothesis: Hypothesis,
    white: Whitener,
    passes: int = FIT_PASSES,
    slope: Floats | None = None,
) -> Fit:
    """Least squares of the whitened residuals with a given noise.

    Args:
        table: stops. hypothesis: from which to begin. white: the noise.
        passes: steps at most.
        slope: (S, M, P) jacobian where it begins, if that is known already.

    Its own bounded Gauss–Newton, not one of scipy's: damping, the step and where it ends are part
    of what the thresholds were chosen with, and slopes are made anew only where they bend.
    """
    precision = prior_precision(hypothesis)
    centre = _centre(hypothesis)
    low, high = hypothesis.bounds

    def cost_of(h: Hypothesis) -> tuple[Floats, float]:
        r = white.rows(white.bins @ residual(table, h)[:, :, None])[:, 0]
        off = h.free - centre
        return r, float(r @ r + off @ (precision * off))

    here = Hypothesis.moved(hypothesis, np.clip(hypothesis.free, low, high))
    r, cost = cost_of(here)
    damping = 1e-6
    slope = jacobian(table, here) if slope is None else slope
    x = white.rows(white.grid @ slope)
    for _ in range(passes):
        # Residual: measured less held speed, plus the fall.
        normal = x.T @ x + np.diag(precision)
        gradient = x.T @ r + precision * (here.free - centre)
        before, at = cost, here.free
        for _ in range(FIT_TRIES):
            step = _bounded_step(
                normal + damping * np.diag(np.diag(normal)), gradient, at, low, high
            )
            if float(gradient @ step) < FIT_DONE:
                break
            trial = here.moved(np.clip(at - step, low, high))
            r_trial, cost_trial = cost_of(trial)
            if cost_trial <= cost:
                here, r, cost = trial, r_trial, cost_trial
                break
            damping = max(damping * 10.0, 1e-4)
        if before - cost < FIT_DONE:
            break
        if before - cost > FIT_BENT:  # nearer than that the slopes are the same
            slope = jacobian(table, here)
            x = white.rows(white.grid @ slope)
        damping *= 0.1
    covariance = np.linalg.pinv(x.T @ x + np.diag(precision), hermitian=True)
    between = white.split(white.bins @ residual(table, here)[:, :, None])[0][:, 0]
    # Few stops tell less of their scatter than its likelihood pretends.
    count = len(table)
    covariance *= count / max(count - (len(here.free) - NUISANCES), 1)
    covariance = _robust(np.asarray(covariance, np.float64), x, r, count)
    each = r[:count] ** 2 + np.sum(r[count:].reshape(count, -1) ** 2, axis=1)
    each = each - 2.0 * np.log(white.weight) + white.log_volume
    deviance = cost - float(r @ r) + float(np.sum(each))
    return Fit(here, 0.5 * (covariance + covariance.T), slope, white, deviance, each, between)


def _robust(covariance: Floats, x: Floats, r: Floats, stops: int) -> Floats:
    """Covariance, wider where stops scatter more along a number than the noise says.

    The sandwich of the scores of whole stops holds whatever the noise within a stop really is
    (White 1980, in clusters); with few stops it comes out too small, so it only ever widens.
    """
    scores = x * r[:, None]
    rest = scores[stops:].reshape(stops, -1, x.shape[1]).sum(axis=1)
    each = scores[:stops] + rest
    sandwich = covariance @ (each.T @ each) @ covariance
    usual = np.maximum(np.diag(covariance), 1e-300)
    wider = np.sqrt(np.clip(np.diag(sandwich) / usual, 1.0, MOST_WIDER**2))
    result: Floats = covariance * np.outer(wider, wider)
    return result


def _centre(hypothesis: Hypothesis) -> Floats:
    """(P,) where the prior draws to: the model as configured."""
    centre = hypothesis.free
    centre[:4] = 0.0
    centre[4] = hypothesis.model.braking.dead_time
    centre[LAWFUL:BASE] = 0.0
    return centre


def _bounded_step(
    normal: Floats, gradient: Floats, at: Floats, low: Floats, high: Floats
) -> Floats:
    """Newton's step; a number that it would push through its bound stays, and the rest again."""
    free = np.ones(len(at), np.bool_)
    for _ in range(len(at)):
        step = np.zeros(len(at))
        step[free] = np.linalg.lstsq(normal[np.ix_(free, free)], gradient[free], rcond=1e-12)[0]
        stuck = free & (((at - step < low) & (at <= low)) | ((at - step > high) & (at >= high)))
        if not stuck.any():
            return step
        free &= ~stuck
    return np.zeros(len(at))


def as_output(table: StopTable, found: Fit) -> StopTable:
    """The table with the speeds that a fit gives, each stop with its own friction.

    A fit to these speeds sees no noise in the terms of motion. Without its friction a stop would
    stop elsewhere, and terms that grow towards standstill would be far off.
    """
    stronger = own_friction(found) / max(float(np.median(table.force)), LEAST_FORCE)
    speed, _ = simulate(table, found.hypothesis, table.held, table.time, stronger[:, None])
    return replace(table, speed=speed)


def own_friction(found: Fit) -> Floats:
    """(S,) most likely F_b/W of each stop beyond what all have in common, as `Noise.scatter`."""
    variance, power = found.noise.scatter**2, found.white.power
    result: Floats = variance * np.sqrt(power) * found.between / (1.0 + variance * power)
    return result


def fit_with_scatter(
    table: StopTable, hypothesis: Hypothesis, noise: Noise, rounds: int = 2
) -> Fit:
    """Fit with the scatter from stop to stop that belongs to this very hypothesis.

    Whatever explains differences between stops is believed only as far as they shrink by it.
    """
    found = fit(table, hypothesis, whitener(table, noise, hypothesis))
    for _ in range(rounds):
        noise = replace(noise, scatter=likely_scatter(found.between, found.white.power))
        white = whitener(table, noise, found.hypothesis)
        found = fit(table, found.hypothesis, white, passes=3, slope=found.jacobian)
    return found


def fit_either_way(table: StopTable, hypothesis: Hypothesis, noise: Noise, rounds: int = 2) -> Fit:
    """As :func:`fit_with_scatter`; whether a friction cap hides scatter is left to likelihood."""
    found = fit_with_scatter(table, hypothesis, noise, rounds)
    if not any(map(is_cap, hypothesis.names)):
        return found
    other = replace(noise, capped=not noise.capped)
    return min(found, fit_with_scatter(table, hypothesis, other, rounds), key=lambda f: f.deviance)


def fit_other_forms(table: StopTable, found: Fit) -> Fit:
    """The best of the forms that effects in it may have, at no more numbers.

    Places may be slippery, or take the same force on any slope. Wheels that slide may drift on a
    cross slope, or hold the vehicle's line, as anti-lock brakes do.
    """
    caps = any(map(is_cap, found.hypothesis.names))
    leans = bool(table.roll.any())
    if any(map(is_placed, found.hypothesis.added)):
        slips = not found.hypothesis.slips
        other = replace(found.hypothesis, slips=slips, drifts=leans and (slips or caps))
        found = min(found, _refit(table, other, found.noise), key=lambda f: f.deviance)
    if leans and (caps or found.hypothesis.slips):
        other = replace(found.hypothesis, drifts=not found.hypothesis.drifts)
        found = min(found, _refit(table, other, found.noise), key=lambda f: f.deviance)
    return found


def _refit(table: StopTable, hypothesis: Hypothesis, noise: Noise) -> Fit:
    return fit_with_scatter(table, hypothesis, noise, rounds=1)


def likely_scatter(between: Floats, power: Floats) -> float:
    """Maximum likelihood of the standard deviation of F_b/W from stop to stop [1].

    Args:
        between: (S,) whitened residual along the friction of each stop.
        power: (S,) its variance for a scatter of one, see :class:`Whitener`.
    """

    def cost(log_scatter: float) -> float:
        variance = 1.0 + np.exp(2.0 * log_scatter) * power
        return float(np.sum(between**2 / variance + np.log(variance)))

    best = minimize_scalar(
        cost, bounds=(np.log(1e-4), np.log(0.5)), method="bounded", options={"xatol": 1e-3}
    )
    return float(np.exp(best.x))


def start_of(table: StopTable, model: Model) -> Hypothesis:
    """The model as configured, moved to where the stops measured one by one are.

    From far away, say a dead time that lasts until standstill, no slope shows the way.
    """
    configured = replace(Hypothesis.configured(model), dead_time=table.onset)
    force = wanted_force(table, configured, ground_of(table))[:, -1]
    off = float(np.median(table.force - force))
    return replace(configured, shift=np.array([0.0, 0.0, 0.0, off]))


def fit_with_noise(table: StopTable, hypothesis: Hypothesis, noise: Noise | None = None) -> Fit:
    """Fit and noise in turn, until both belong to each other."""
    now = noise or Noise(0.03, 0.0, 0.1, max(table.dead_time_std, 2e-3), 0.01)
    found = fit(table, hypothesis, whitener(table, now, hypothesis), passes=4)
    for _ in range(NOISE_PASSES):
        now = noise_of(table, found)
        found = fit(table, found.hypothesis, whitener(table, now, found.hypothesis), passes=4)
    return fit_with_scatter(table, found.hypothesis, now)


def fit_base(table: StopTable, start: Hypothesis) -> Fit:
    """The model's own numbers and the noise that belongs to them.

    The body's oscillation is fitted along only where the log shows it plainly: in short stops it
    looks like a weak effect of speed.
    """
    plain = fit_with_noise(table, start)
    oscillating = fit_with_noise(table, replace(plain.hypothesis, oscillates=True), plain.noise)
    return oscillating if oscillating.deviance < plain.deviance - OSCILLATES else plain


def with_build_up(table: StopTable, found: Fit, noise: Noise | None = None) -> Fit:
    """The same with a build-up of the brakes, if it leaves a trace.

    No brake bites at once. What it takes is mostly a later onset; the rest would be called a drag,
    a lag or a pattern along the time since onset in every log that is measured well.
    """
    lags = [name for name, law in LAWS.items() if law.enters is Enters.LAG]
    if any(e.name in lags for e in (*found.hypothesis.model.effect, *found.hypothesis.added)):
        return found
    refit = fit_with_noise if noise is None else fit_with_scatter
    own = Effect(name=lags[0], parameters={"tau": FIRST_BUILD_UP})
    onset = max(found.hypothesis.dead_time - FIRST_BUILD_UP, 0.0)
    built = replace(found.hypothesis, dead_time=onset).plus(own)
    best = refit(table, built, noise or found.noise)
    if best.deviance >= found.deviance - BUILD_UP_SEEN:
        return found
    if best.hypothesis.oscillates or lag_of(best.hypothesis) < QUICK_BUILD_UP:
        return best
    shaped = refit(table, replace(best.hypothesis, oscillates=True), noise or best.noise)
    return shaped if shaped.deviance < best.deviance - OSCILLATES else best


def noise_of(table: StopTable, found: Fit) -> Noise:
    """The noise that a fit leaves."""
    left = residual(table, found.hypothesis)
    return estimate(table, left, found.hypothesis, found.noise.capped)
