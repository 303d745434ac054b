"""Onset fit of one stop: when the brakes took hold, at which speed, and with which force.

The speed of a stop is a held level, a knee at the onset, and a fall whose slope is the force and
gravity: v(t) = v_i − g ∫ (F_b/W + sin θ) dt from the onset on. With θ(t) known the integral is
linear in the force, so that nothing has to be differentiated and slopes that vary along the stop
are exact. Force, onset time and onset speed come with their covariance.

Validity: constant brake application, white or weakly correlated speed noise. Omits: gradual build
up of the force, which shows as a later onset. Source: Braking (1), (2), integrated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY

CREEP = 0.4  # [m/s²] how far a held speed may be from held, as a standard deviation
HELD = (0.03 / CREEP) ** 2  # the same as a weight relative to speed noise of 3 cm/s [s²]
_COARSE, _FINE = 24, 12  # onset times tried
_EARLIEST = -0.05  # [s] commands are logged up to a sample late
_LOW = 0.05  # share of the held speed below which sensors and brakes do other things
_EARLY = 0.05  # [s] noise makes the speed cross zero that much too early
_MIN_SAMPLE_COUNT = 2  # after the onset, for a slope of the speed; earlier ones show the noise
_STILL_FAST = 0.7  # share of the held speed that the vehicle has at the onset, at least


@dataclass(frozen=True, slots=True)
class Oscillation:
    """Speed of the wheels against that of a body that pitches on its springs while it is braked.

    The wheels are ahead of the body's fall by the deceleration times ``lead``: the response of a
    damped oscillator to the brakes. Where the pitch rate is logged, by ``height`` times that.
    """

    gain: float = 0.0  # height of the body above its pitch axis times the dive [s²]
    frequency: float = 1.0  # natural frequency [rad/s]
    damping: float = 0.5  # ratio, below 1
    height: float = 0.0  # of the body above its pitch axis [m]

    def lead(self, since: Floats) -> Floats:
        """Time by which the wheels are ahead, at times after the onset [s]; 0 before it."""
        after, root = np.maximum(since, 0.0), np.sqrt(1.0 - self.damping**2)
        decay = np.exp(-self.damping * self.frequency * after)
        ring = np.sin(root * self.frequency * after) / root
        result: Floats = self.gain * self.frequency * decay * ring
        return result


@dataclass(frozen=True, slots=True)
class Knee:
    """One stop in numbers; variances are those for a speed noise of 1 m/s."""

    onset_speed: float  # v_i [m/s]
    onset_time: float  # since the stop command [s]
    force_ratio: float  # F_b/W at the mean grade of the braking
    covariance: Floats  # (3, 3) of onset_speed, onset_time, force_ratio
    rms: float  # root mean square of the residuals [m/s]
    correlation: float  # between consecutive residuals
    samples: int  # that were fitted
    mean_grade: float  # time average of θ from onset to standstill [rad]
    creep: float  # change of the held speed before the onset [m/s²]
    creep_variance: float
    held_weight: float = HELD  # that it was fitted with [s²]


def fit_knee(
    time: Floats,
    speed: Floats,
    grade: Floats,
    standstill_time: float,
    slope: float = 0.0,
    held_weight: float = HELD,
    oscillation: Oscillation | None = None,
) -> Knee | None:
    """Least squares of held speed, knee and fall; None with too few samples, or without a fall.

    Args:
        time: (n,) since the stop command [s], increasing, from before it to standstill or after.
        speed: (n,) [m/s]. grade: (n,) θ of the ground [rad], uphill positive.
        standstill_time: first zero crossing since the command [s].
        slope: change of F_b/W with grade; it matters where the grade varies along the stop.
        held_weight: (speed noise over the standard deviation of the creep)² [s²], the weight
            of the evidence that held speeds are held.
    """
    level = float(np.mean(speed[time <= 0.0])) if (time <= 0.0).any() else float(speed[0])
    fast = np.flatnonzero((time <= standstill_time) & (speed >= _STILL_FAST * level))
    latest = min(0.9 * standstill_time, float(time[fast[-1]]) if len(fast) else 0.0)
    pull = _Pull(time, grade, slope, held_weight, oscillation)
    # Which samples belong to the fall must not depend on their own noise: the first cut is by the
    # crossing, the second by the first fit.
    t, v = _until(time, speed, (1.0 - _LOW) * standstill_time)
    if len(t) < _MIN_SAMPLE_COUNT + 2 or latest <= 0.0:
        return None
    onset = _best_onset(t, v, pull, standstill_time, _EARLIEST, latest, _COARSE)
    first = _solve(t, v, pull, np.array([onset]), standstill_time).solution[0]
    fall = _fall_time(first, pull, onset, standstill_time)
    t, v = _until(time, speed, min(onset + (1.0 - _LOW) * fall, standstill_time + _EARLY))
    if len(t) < _MIN_SAMPLE_COUNT + 2:
        return None
    near = 2.0 * (latest - _EARLIEST) / _COARSE
    low, high = max(onset - near, _EARLIEST), min(onset + near, latest)
    onset = _best_onset(t, v, pull, onset + fall, low, high, _FINE)
    solved = _solve(t, v, pull, np.array([onset]), onset + fall)
    if int((t > onset).sum()) < _MIN_SAMPLE_COUNT:
        return None
    return _knee(solved, t, pull, onset, onset + fall)


def _until(time: Floats, speed: Floats, end: float) -> tuple[Floats, Floats]:
    stop = int(np.searchsorted(time, end, side="right"))
    return time[:stop], speed[:stop]


def _fall_time(solution: Floats, pull: _Pull, onset: float, standstill_time: float) -> float:
    """From onset to standstill by a fit; no more than half as long again as was measured."""
    sine = float(np.sin(pull.mean_grade(onset, standstill_time)))
    deceleration = GRAVITY * (float(solution[2]) + sine)
    longest = 1.5 * (standstill_time - onset)
    return min(float(solution[0]) / deceleration, longest) if deceleration > 0.0 else longest


def _best_onset(
    t: Floats, v: Floats, pull: _Pull, standstill_time: float, low: float, high: float, count: int
) -> float:
    """The onset of least squares between two times: tried ones, then the vertex of a parabola."""
    onsets = np.linspace(low, high, count)
    cost = _solve(t, v, pull, onsets, standstill_time).cost
    k = min(max(int(cost.argmin()), 1), count - 2)
    before, here, after = cost[k - 1 : k + 2].tolist()
    second_difference = before - 2.0 * here + after
    shift = 0.5 * (before - after) / second_difference if second_difference > 0.0 else 0.0
    return float(onsets[k] + min(max(shift, -1.0), 1.0) * (onsets[1] - onsets[0]))


class _Pull:
    """Integrals of sin θ + slope (θ − mean) over time, and mean grades."""

    def __init__(
        self,
        time: Floats,
        grade: Floats,
        slope: float,
        held_weight: float,
        oscillation: Oscillation | None,
    ) -> None:
        self.time, self.grade, self.slope, self.held = time, grade, slope, held_weight
        self.oscillation = oscillation
        self._grade = _cumulative(time, grade)
        self._sine_and_slope = _cumulative(time, np.sin(grade)) + slope * self._grade

    def mean_grade(self, since: Floats | float, until: float) -> Floats:
        """Time average of θ from each beginning (n,), or one, to the end [rad]."""
        first, last = float(self.time[0]), float(self.time[-1])
        begin = np.minimum(np.maximum(since, first), last)
        span = min(max(until, first), last) - begin
        turned = np.interp(until, self.time, self._grade) - np.interp(begin, self.time, self._grade)
        short = span <= 1e-9
        if not np.any(short):
            return np.asarray(turned / span, np.float64)
        here = np.interp(begin, self.time, self.grade)
        return np.where(short, here, turned / np.where(short, 1.0, span))

    def after(self, onset: Floats, until: float, since: Floats) -> Floats:
        """(K, n) ∫ from each onset (K,) to samples `since` (K, n) after it, 0 before [s]."""
        at_onset = np.interp(onset, self.time, self._sine_and_slope)
        integral = self._sine_and_slope[: since.shape[1]] - at_onset[:, None]
        if self.slope:
            integral -= (self.slope * self.mean_grade(onset, until))[:, None] * since
        integral[since <= 0.0] = 0.0
        return integral


def _cumulative(time: Floats, values: Floats) -> Floats:
    integral = np.zeros(len(values))
    np.cumsum(0.5 * (values[1:] + values[:-1]) * (time[1:] - time[:-1]), out=integral[1:])
    return integral


class _Solved(NamedTuple):
    """Held speed, creep before the onset and force for each of K onset times.

    The columns of the design are one of ones, ``before`` and ``fall``.
    """

    before: Floats  # (K, n) time before the onset [s]
    fall: Floats  # (K, n) speed that gravity takes after it [m/s]
    solution: Floats  # (K, 3)
    residual: Floats  # (K, n) [m/s]
    cost: Floats  # (K,) [m²/s²]


def _solve(t: Floats, v: Floats, pull: _Pull, onset: Floats, standstill_time: float) -> _Solved:
    since = t - onset[:, None]
    before = np.minimum(since, 0.0)
    fall = -GRAVITY * np.maximum(since, 0.0)
    target = v + GRAVITY * pull.after(onset, standstill_time, since)
    if pull.oscillation is not None and pull.oscillation.gain:
        lead = GRAVITY * pull.oscillation.lead(since)
        fall -= lead
        target += np.sin(pull.mean_grade(onset, standstill_time))[:, None] * lead
    # Normal equations by elimination: no sample is both before and after the onset.
    ones = np.ones(len(t))
    by_before, by_fall = before @ ones, fall @ ones
    # Held speeds are held: the creep needs evidence.
    creep_weight = np.einsum("kn,kn->k", before, before) + pull.held
    fall_weight = np.einsum("kn,kn->k", fall, fall) + 1e-9
    to_before = np.einsum("kn,kn->k", before, target)
    to_fall = np.einsum("kn,kn->k", fall, target)
    right = target @ ones - by_before * to_before / creep_weight - by_fall * to_fall / fall_weight
    speed = right / (len(t) - by_before**2 / creep_weight - by_fall**2 / fall_weight)
    creep = (to_before - by_before * speed) / creep_weight
    force = (to_fall - by_fall * speed) / fall_weight
    residual = target - speed[:, None] - creep[:, None] * before - force[:, None] * fall
    cost = np.einsum("kn,kn->k", residual, residual) + pull.held * creep**2
    return _Solved(before, fall, np.array((speed, creep, force)).T, residual, cost)


def _jacobian(solved: _Solved, t: Floats, pull: _Pull, onset: float) -> Floats:
    """(4, n) change of the speeds with onset speed, creep, force and onset time."""
    _, creep, force = solved.solution[0].tolist()
    sine = np.sin(float(np.interp(onset, pull.time, pull.grade)))
    by_onset = np.where(t > onset, GRAVITY * (force + sine), -creep)
    return np.array((np.ones(len(t)), solved.before[0], solved.fall[0], by_onset))


def residuals(
    knee: Knee, time: Floats, speed: Floats, grade: Floats, oscillation: Oscillation | None
) -> tuple[Floats, Floats, Floats]:
    """Time since the onset (n,) [s], residuals (n,) [m/s] of a fit, and what it follows (n, 4).

    The latter are orthonormal columns; arguments as of :func:`fit_knee`, on ground of one grade.
    """
    pull = _Pull(time, grade, 0.0, knee.held_weight, oscillation)
    t, v = time[: knee.samples], speed[: knee.samples]
    solved = _solve(t, v, pull, np.array([knee.onset_time]), float(t[-1]))
    follows, _ = np.linalg.qr(_jacobian(solved, t, pull, knee.onset_time).T)
    return t - knee.onset_time, solved.residual[0], follows


def _knee(solved: _Solved, t: Floats, pull: _Pull, onset: float, standstill_time: float) -> Knee:
    residual = solved.residual[0]
    speed, creep, force = (float(x) for x in solved.solution[0])
    jacobian = _jacobian(solved, t, pull, onset)
    normal = jacobian @ jacobian.T
    normal[1, 1] += pull.held
    normal[np.diag_indices(4)] += 1e-12
    covariance: Floats = np.asarray(np.linalg.inv(normal), np.float64)
    order = np.array([0, 3, 2])
    freedom = max(len(t) - 4, 1)
    sum_sq = float(residual @ residual)
    correlation = float(residual[1:] @ residual[:-1]) / max(sum_sq, 1e-300)
    return Knee(
        speed,
        onset,
        force,
        covariance[np.ix_(order, order)],
        float(np.sqrt(sum_sq / freedom)),
        correlation,
        len(t),
        float(pull.mean_grade(onset, standstill_time)),
        creep,
        float(covariance[1, 1]),
        pull.held,
    )
