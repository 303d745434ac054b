"""The grade of the ground from the pitch of a body that dives and a misaligned sensor.

pitch = −θ + mount + dive · (a(t) − g sin θ): a body leans with the specific force that it feels
through its suspension, the deceleration a(t) less gravity along the slope. On a soft one the dive
is about 1° at 3.5 m/s²; taken for ground, it makes every downhill look steeper just while it is
measured, and predictions downhill too short. Gravity's part is there all the time: a body leans
towards the foot of a slope, and its pitch is steeper than the ground by a share of g · dive.

The dive shows in each single stop: the body pitches when the brakes take hold and comes back
when the vehicle stands, while the ground continues smoothly. The mount does not show: a
constant offset looks like ground. It takes a map, heights, or the same ground driven in several
directions (:mod:`slopewise.models.stop_logs.mount_offset`).

Validity: dive proportional to deceleration; ground that is smooth over the length of a stop.
Source: Braking (2), where θ is the ground's; print takes the pitch of the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs import random_effects

_SETTLING = (0.0, 0.03, 0.06, 0.1, 0.15, 0.22, 0.3)  # [s] time constants tried
_DIVE_PRIOR = 0.02  # [rad s²/m] twice the dive of a soft suspension
_MIN_SAMPLE_COUNT = 8  # samples of pitch that a stop must have
_MIN_GRADE_COUNT = 5  # grades from which their own scatter is known
_MIN_SHARE = 1e-3  # of the dive's shape that ground cannot explain


@dataclass(frozen=True, slots=True)
class StopPitch:
    """Pitch around one stop, (n,) samples."""

    time: Floats  # since the stop command [s], from before it to some time after standstill
    station: Floats  # distance since the first sample [m]
    pitch: Floats  # [rad], nose down positive
    onset_time: float  # start of braking [s]
    standstill_time: float  # and its end [s]
    deceleration: float  # its mean [m/s²]

    def felt_deceleration(self, settling: float) -> Floats:
        """(n,) deceleration as the body follows it, first order with a time constant [m/s²]."""
        since_onset = np.maximum(self.time - self.onset_time, 0.0)
        since_rest = np.maximum(self.time - self.standstill_time, 0.0)
        if settling <= 0.0:
            braking = (self.time > self.onset_time) & (self.time <= self.standstill_time)
            return np.where(braking, self.deceleration, 0.0)
        built = np.minimum(since_onset, self.standstill_time - self.onset_time)
        return self.deceleration * -np.expm1(-built / settling) * np.exp(-since_rest / settling)


@dataclass(frozen=True, slots=True)
class Dive:
    """How the body pitches under braking."""

    per_deceleration: float = 0.0  # [rad per m/s²]
    std: float = _DIVE_PRIOR  # of it
    settling: float = 0.0  # time constant of the suspension [s]

    @property
    def steeper(self) -> float:
        """Pitch of a body at rest or at even speed over the grade that it is on [1]."""
        return 1.0 + GRAVITY * self.per_deceleration

    def pitch(self, stop: StopPitch) -> Floats:
        """(n,) pitch by the deceleration at the samples of a stop [rad]."""
        return self.per_deceleration * stop.felt_deceleration(self.settling)


def estimate_dive(stops: Sequence[StopPitch]) -> Dive:
    """The dive that the pitch of all stops has in common.

    In each stop the ground is a parabola over the distance; the remainder of the pitch follows
    the deceleration. Stops are weighted by their information, outliers rejected.
    """
    usable = [
        s for s in stops if len(s.time) >= _MIN_SAMPLE_COUNT and s.standstill_time > s.onset_time
    ]
    if not usable:
        return Dive()
    grounds = [_ground(stop.station) for stop in usable]
    trials = [_estimate(usable, grounds, settling) for settling in _SETTLING]
    return min(trials, key=lambda trial: trial[0])[1]


def _ground(station: Floats) -> Floats:
    """(n, 3) orthonormal columns of parabolas over the distance."""
    x = station / max(float(np.ptp(station)), 1e-6)
    columns, _ = np.linalg.qr(np.column_stack((np.ones_like(x), x, x * x)))
    return columns


def _estimate(
    stops: Sequence[StopPitch], grounds: Sequence[Floats], settling: float
) -> tuple[float, Dive]:
    single, information, remains, counts = [], [], [], []
    for stop, ground in zip(stops, grounds, strict=True):
        shape = stop.felt_deceleration(settling)
        felt = shape - ground @ (ground.T @ shape)
        pitch = stop.pitch - ground @ (ground.T @ stop.pitch)
        power = float(felt @ felt)
        if power < _MIN_SHARE * float(shape @ shape) or power <= 0.0:
            continue
        single.append(float(felt @ pitch) / power)
        information.append(power)
        remains.append(float(pitch @ pitch) - single[-1] ** 2 * power)
        counts.append(len(shape) - 4)
    if not single:
        return np.inf, Dive(settling=settling)
    each, weight = np.array(single), np.array(information)
    noise = np.sqrt(sum(remains) / max(sum(counts), 1) / weight)
    fit = random_effects.fit_mean(each, np.maximum(noise, 1e-9), 0.0, _DIVE_PRIOR)
    value = float(fit.coefficients[0])
    cost = sum(remains) + float(np.sum(weight * np.minimum((each - value) ** 2, noise**2 * 9.0)))
    return cost, Dive(value, float(np.sqrt(fit.covariance[0, 0])), settling)


def shrunk(grade: Floats, noise: Floats) -> Floats:
    """(n,) best estimates of grades that were measured with noise: drawn towards their mean.

    An error of the grade is also one of the gravity-free force, with the opposite sign. On ground
    that is level within the noise, a regression on the measured grades would find these errors and
    a slope coefficient near −1. Slopes well beyond the noise (n,) [rad] are not changed.
    """
    n = len(grade)
    if n < _MIN_GRADE_COUNT:
        return grade
    variance = float(np.mean(noise**2))
    real = float(np.var(grade, ddof=1)) - variance * (1.0 + 3.0 * np.sqrt(2.0 / (n - 1)))
    trust = max(real, 0.0) / (max(real, 0.0) + noise**2 + 1e-18)
    return np.asarray(np.mean(grade) + trust * (grade - np.mean(grade)))
