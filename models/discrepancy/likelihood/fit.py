"""The onset and the noise, fitted under each explanation.

All four numbers of the onset are moved together, the noise in between, from the onset of another
explanation or a quick one, and from a lag: under an explanation that lacks an effect, a slow swing
of the body and a large residual at the onset can pass for a lag, and no path leads back from there.
Then the evidence is followed over all build-ups.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate, Dictionary, prior_of
from slopewise.models.discrepancy.likelihood.gaussian import Grams, Solved
from slopewise.models.discrepancy.likelihood.marginal import (
    by_noise,
    mixed,
    of_noise,
    share_changed,
    solved_both,
)
from slopewise.models.discrepancy.likelihood.onset import DAMPING, OSCILLATION, Integrated, Onset
from slopewise.models.discrepancy.likelihood.trace import Trace, grams_at
from slopewise.models.discrepancy.model.hypothesis import MAX_STEPS

BUILD_UPS = np.array([0.005, 0.012, 0.025, 0.045, 0.075, 0.12, 0.18, 0.27, 0.4, 0.6])
"""Time constants at which the evidence is computed [s]."""
_OSCILLATIONS = (1.5, 3.0, 5.0)  # natural frequencies that it starts from [Hz]
_SCALE = np.array([0.004, 0.15, 0.08, 0.15])  # of dead time [s], and logarithms of the others [1]
_STEP = 0.05  # of derivatives, in these scales
_SETTLING = 2  # steps of the dead time
HOPELESS = 60.0  # evidence by which a build-up is too much worse to be followed further
_MAX_SHIFT = 0.05  # by which a dead time is negative, or moves in a step [s]
_TURNS, _GAIN = 5, 0.5  # of a fit at most; evidence below which it has converged


@dataclass(frozen=True, slots=True)
class Fit:
    """An explanation at every build-up.

    Attributes:
        trace: columns of the log. extra: columns of `chosen`.
        chosen: candidates in it. onsets: (T,) state at each. noise: (6,) of the stops.
        evidence: (T,) ln of the marginal likelihood. solutions: (T,) all columns, solved.
        log_prior: ln of the prior of its names, grids and signs. settled: the onset is its own.
    """

    trace: Trace
    extra: Integrated
    chosen: tuple[Candidate, ...]
    onsets: tuple[Onset, ...]
    noise: Floats
    evidence: Floats
    solutions: tuple[Solved, ...]
    log_prior: float
    settled: bool

    @property
    def log_weight(self) -> float:
        """Tempered, at its best build-up."""
        return self.log_prior + prior.TEMPER * float(self.evidence.max())

    @property
    def best(self) -> int:
        """Index of the build-up with the most evidence."""
        return int(np.argmax(self.evidence))


class Problem:
    """The evidence of one explanation, as a function of onset and noise."""

    def __init__(self, trace: Trace, extra: Integrated, chosen: Sequence[Candidate]) -> None:
        self.trace, self.extra, self.chosen = trace, extra, tuple(chosen)
        self.std, self.centre = prior_of(chosen)

    def grams(self, onset: Onset) -> tuple[Grams, Floats]:
        """Products, and (P,) deviations."""
        grams, std = grams_at(self.trace, onset, self.extra)
        return grams, np.append(std, self.std)

    def solve(self, grams: Grams, std: Floats, noise: Floats) -> Solved:
        """All columns integrated out."""
        solutions = solved_both(grams, std, noise, self.trace.calibrated, self._centre(std))
        evidence = mixed(solutions[0].evidence, solutions[1].evidence)
        changed = share_changed(solutions[1].evidence, evidence)
        return replace(solutions[changed > 0.5], evidence=evidence, changed=changed)

    def _centre(self, std: Floats) -> Floats:
        return np.concatenate([np.zeros(len(std) - len(self.centre)), self.centre])

    def at(self, onset: Onset, noise: Floats) -> Solved:
        """All columns integrated out at a state."""
        return self.solve(*self.grams(onset), noise)

    def evidence(self, onset: Onset, noise: Floats) -> float:
        """Of a state, with the prior of its noise."""
        return self.at(onset, noise).evidence + of_noise(noise)

    def settled(self, onset: Onset, noise: Floats) -> tuple[Onset, Solved]:
        """With the dead time where it belongs."""
        best = onset, self.at(onset, noise)
        for _ in range(_SETTLING):
            step = float(np.clip(best[1].mean[0], -_MAX_SHIFT, _MAX_SHIFT))
            moved = replace(onset, dead_time=max(best[0].dead_time + step, -_MAX_SHIFT))
            now = self.at(moved, noise)
            if now.evidence < best[1].evidence:
                break
            best = moved, now
        return best

    def onset(self, start: Onset, noise: Floats) -> Onset:
        """Of largest evidence near a start."""

        def at(x: Floats) -> Onset:
            tau, oscillation, damping = np.exp(np.clip(x[1:], np.log(3e-3), np.log(8.0)))
            return replace(
                start,
                dead_time=max(float(x[0]), -_MAX_SHIFT),
                build_up=float(min(tau, 0.8)),
                oscillation=float(oscillation),
                damping=float(min(damping, 1.0)),
            )

        def loss(z: Floats) -> float:
            y = x + _SCALE * z
            deviation = (y[2:] - typical) / prior.LOG_SPREAD
            return float(0.5 * (deviation @ deviation) - self.at(at(y), noise).evidence)

        typical = np.log([OSCILLATION, DAMPING])
        x = np.array([start.dead_time, *np.log([start.build_up, start.oscillation, start.damping])])
        options = {"maxfun": MAX_STEPS, "ftol": 1e-5, "maxls": 6, "eps": _STEP}
        best = minimize(loss, np.zeros(4), method="L-BFGS-B", options=options)
        return at(x + _SCALE * best.x)

    def noise(self, onset: Onset, start: Floats) -> Floats:
        """(6,) noise of largest evidence."""
        grams, std = self.grams(onset)
        centre = self._centre(std)

        def loss(log_noise: Floats) -> tuple[float, Floats]:
            value, slope = by_noise(grams, std, np.exp(log_noise), self.trace.calibrated, centre)
            return -value, -slope

        options = {"maxfun": MAX_STEPS, "ftol": 1e-6, "maxls": 8}
        best = minimize(loss, np.log(start), method="L-BFGS-B", jac=True, options=options)
        return np.asarray(np.exp(best.x), np.float64)


def fit(
    trace: Trace,
    book: Dictionary,
    chosen: Sequence[Candidate],
    log_prior: float = 0.0,
    starts: Sequence[Fit] = (),
) -> Fit:
    """Fit onset and noise under an explanation, from those of others where there are any."""
    problem = Problem(trace, book.columns.take([i for c in chosen for i in c.index]), chosen)
    noise, typical_lag = _noise_before(trace), float(np.sqrt(np.prod(prior.LAG)))
    tried = [(_typical(problem, typical_lag, noise), noise)]
    if starts:
        states = [(s.onsets[s.best], s.noise) for s in starts]
        tried.append(max(states, key=lambda s: problem.at(*s).evidence))
    else:
        tried.append((_typical(problem, prior.BUILD_UP, noise), noise))
    tried = [(onset, problem.noise(onset, noise)) for onset, noise in tried]
    near = [problem.evidence(*state) for state in tried]
    min_evidence = max(near) - HOPELESS
    fitted = [_converged(problem, *s) for s, e in zip(tried, near, strict=True) if e > min_evidence]
    best = max(fitted, key=lambda s: problem.evidence(*s))
    return _followed(problem, log_prior, *best)


def quick_fit(book: Dictionary, chosen: Sequence[Candidate], log_prior: float, near: Fit) -> Fit:
    """As :func:`fit`, at the onset of another explanation: only the noise is its own."""
    problem = Problem(near.trace, book.columns.take([i for c in chosen for i in c.index]), chosen)
    onset = near.onsets[near.best]
    noise = problem.noise(onset, near.noise)
    solution = problem.at(onset, noise)
    gain = solution.evidence + of_noise(noise) - float(near.evidence.max())
    return replace(
        near,
        extra=problem.extra,
        chosen=problem.chosen,
        noise=noise,
        evidence=near.evidence + gain,
        solutions=(solution,) * len(near.onsets),
        log_prior=log_prior,
        settled=False,
    )


def _noise_before(trace: Trace) -> Floats:
    """(6,) with the scatter of the stops."""
    noise, force = prior.NOISE.copy(), trace.table.force
    # Wild stops would hide in waves and axes before their scatter was found.
    deviation = np.median(np.abs(force - np.median(force)))
    noise[1] = max(float(deviation) / trace.force, noise[1])
    return noise


def _typical(problem: Problem, build_up: float, noise: Floats) -> Onset:
    """The likeliest onset with a build-up, of some bodies."""
    dead_time = problem.trace.table.onset + prior.BUILD_UP - 0.7 * build_up
    tried = [problem.settled(Onset(dead_time, build_up, f), noise) for f in _OSCILLATIONS]
    return max(tried, key=lambda t: t[1].evidence)[0]


def _converged(problem: Problem, onset: Onset, noise: Floats) -> tuple[Onset, Floats]:
    """Onset and noise in turns, until nothing is gained."""
    best = (onset, noise)
    max_evidence = problem.evidence(*best)
    for _ in range(_TURNS):
        onset = problem.onset(*best)
        state = (onset, problem.noise(onset, best[1]))
        before, now = max_evidence, problem.evidence(*state)
        if now > max_evidence:
            best, max_evidence = state, now
        if max_evidence < before + _GAIN:
            break
    return best


def _followed(problem: Problem, log_prior: float, best: Onset, noise: Floats) -> Fit:
    """Over all build-ups, outward from the best one, the dead time relinearised at each."""
    taus = np.unique(np.append(BUILD_UPS, best.build_up))
    middle = int(np.searchsorted(taus, best.build_up))
    state_at: dict[int, tuple[Onset, Solved]] = {}
    for order in (range(middle, len(taus)), range(middle - 1, -1, -1)):
        near = best if not state_at else state_at[middle][0]
        for i in order:
            # What the build-up delays, the dead time gives back.
            moved = near.dead_time - 0.8 * (taus[i] - near.build_up)
            at = replace(near, dead_time=max(float(moved), -_MAX_SHIFT), build_up=float(taus[i]))
            state_at[i] = (at, problem.at(at, noise)) if i == middle else problem.settled(at, noise)
            near = state_at[i][0]
            if state_at[i][1].evidence < state_at[middle][1].evidence - HOPELESS:
                break
    known = sorted(state_at)
    return Fit(
        problem.trace,
        problem.extra,
        problem.chosen,
        tuple(state_at[i][0] for i in known),
        noise,
        np.array([state_at[i][1].evidence for i in known]) + of_noise(noise),
        tuple(state_at[i][1] for i in known),
        log_prior,
        settled=True,
    )
