"""Swing of the wheels' speed against the body's, from all stops of a log.

A sprung body pitches when the brakes take hold. Wheels read v_body − h · pitch rate, with the
height h of the body above its pitch axis: 0.1 m/s at the onset of soft springs, enough to make
brakes look early and the force depend on grade and speed. Where the log has the pitch rate, h is
all that is unknown; else the response is that of a damped oscillator to the deceleration.

It is told from brakes that build up or change while the vehicle slows, whose residuals have another
shape: the swing is taken out only where no such shape explains the stops as well.
Source: none; standard vehicle dynamics.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.onset import Knee, Swing, residuals
from slopewise.models.stop_logs.stop_record import StopSamples

_FREQUENCIES = 2.0 * np.pi * np.geomspace(0.6, 4.5, 12)
"""Tried first [rad/s]: pitch of vehicles on springs or tyres."""
_DAMPING = (0.1, 0.2, 0.35, 0.55, 0.8)
_BUILD_UP = (0.03, 0.06, 0.12, 0.25, 0.5)  # [s] time constants of brakes that are no swing
_MIN_GAIN = 40.0
"""Reduction of the squared residuals, in their variance, from which a swing is certain [1]: six
standard deviations, squared, and some more for what neighbouring samples share."""
_MAX_STOP_COUNT = 40
"""Stops that the swing is fitted to [1]: more cost time and hardly sharpen it."""
_MIN_STOP_COUNT = 5
_PASSES = 4
"""Gauss-Newton steps [1]: the third changes nothing that matters."""
_DIFFERENCE = 1e-3  # of the same, for derivatives
_LARGEST_STEP = 0.3  # of the logarithms of gain and frequency, and of the damping
_DAMPING_RANGE = 0.05, 0.95

Refit = Callable[[int, Swing | None], Knee | None]
"""Fit of a stop, by its index, with a swing."""
Shape = Callable[[Floats], Floats]
"""Speed that is lost per deceleration, at times since the onset (n,) [s]."""


def swing_of(stops: Sequence[StopSamples], grounds: Sequence[Floats], refit: Refit) -> Swing | None:
    """The swing that the stops share, None where they show none.

    Args:
        stops: samples. grounds: (n,) grades of each [rad]. refit: fit of a stop with a swing.
    """
    chosen = range(0, len(stops), max(len(stops) // _MAX_STOP_COUNT, 1))
    if len(chosen) < _MIN_STOP_COUNT:
        return None

    def pool(swing: Swing | None) -> _Pool:
        return _Pool([(stops[i], refit(i, swing), grounds[i]) for i in chosen], swing)

    if all(s.pitch_rate is not None and np.isfinite(s.pitch_rate).all() for s in stops):
        return _by_pitch_rate(pool)
    plain = pool(None)
    swings = [Swing(1.0, f, d) for f in _FREQUENCIES.tolist() for d in _DAMPING]
    explained = [plain.explained(swing.lead) for swing in swings]
    best = max(range(len(swings)), key=lambda k: explained[k][1])
    size, gain = explained[best]
    rival = max(plain.explained(shape)[1] for shape in _rivals())
    if size <= 0.0 or gain < max(_MIN_GAIN, rival):
        return None
    return _refined(dataclasses.replace(swings[best], gain=size), pool)


def _rivals() -> Iterator[Shape]:
    """Shapes of brakes that build up, and of a deceleration that changes."""

    def build_up(tau: float) -> Shape:
        return lambda since: -np.expm1(-np.maximum(since, 0.0) / tau)

    yield from map(build_up, _BUILD_UP)
    yield lambda since: np.maximum(since, 0.0) ** 2


def _by_pitch_rate(pool: Callable[[Swing | None], _Pool]) -> Swing | None:
    """The swing as a height times the pitch rate of the log."""
    plain = pool(None)
    height, gain = plain.explained(None)
    if height <= 0.0 or gain < _MIN_GAIN:
        return None
    for _ in range(_PASSES):
        height = max(height + pool(Swing(height=height)).explained(None)[0], 0.0)
    return Swing(height=height)


def _refined(swing: Swing, pool: Callable[[Swing | None], _Pool]) -> Swing:
    """The swing of least squares, the stops fitted anew with each step."""
    x = np.array([np.log(swing.gain), np.log(swing.frequency), swing.damping])

    def at(x: Floats) -> Swing:
        gain, frequency = np.exp(x[:2]).tolist()
        return Swing(gain, frequency, float(np.clip(x[2], *_DAMPING_RANGE)))

    def shape_of(change: Floats) -> Shape:
        there, here = at(x + change), at(x)
        return lambda since: (there.lead(since) - here.lead(since)) / _DIFFERENCE

    for _ in range(_PASSES):
        shapes = [shape_of(_DIFFERENCE * unit) for unit in np.eye(3)]
        x = x + np.clip(pool(at(x)).step(shapes), -_LARGEST_STEP, _LARGEST_STEP)
    return at(x)


class _Pool:
    """Residuals of several stops, each in its own noise."""

    def __init__(
        self, stops: Sequence[tuple[StopSamples, Knee | None, Floats]], swing: Swing | None
    ) -> None:
        self.parts = []
        for stop, knee, ground in stops:
            if knee is None:
                continue
            new, rate = stop.fresh, stop.pitch_rate
            speed = stop.speed
            if rate is not None and swing is not None:
                speed = speed + swing.height * rate
            since, residual, follows = residuals(
                knee, stop.time[new], speed[new], ground[new], stop.standstill_time, swing
            )
            slowing = GRAVITY * (knee.force_ratio + np.sin(knee.mean_grade))
            lost = None if rate is None else -rate[new][: knee.samples]
            self.parts.append((since, residual / knee.rms, follows, -slowing, lost, knee.rms))

    def _columns(self, shapes: Sequence[Shape | None]) -> Iterator[tuple[Floats, Floats]]:
        """(n, k) shapes of each stop that its fit does not follow, and (n,) its residuals."""
        for since, residual, follows, slowing, lost, rms in self.parts:
            columns = np.array([lost if s is None else slowing * s(since) for s in shapes]).T / rms
            yield columns - follows @ (follows.T @ columns), residual

    def step(self, shapes: Sequence[Shape | None]) -> Floats:
        """(k,) sizes of some shapes in all stops, by least squares."""
        normal, right = np.zeros((len(shapes), len(shapes))), np.zeros(len(shapes))
        for columns, residual in self._columns(shapes):
            normal += columns.T @ columns
            right += columns.T @ residual
        return np.asarray(np.linalg.lstsq(normal, right, rcond=1e-9)[0], np.float64)

    def explained(self, shape: Shape | None) -> tuple[float, float]:
        """Size of a shape (None: the pitch rate), and its reduction of the squared residuals."""
        agree = power = 0.0
        for columns, residual in self._columns([shape]):
            agree += float(columns[:, 0] @ residual)
            power += float(columns[:, 0] @ columns[:, 0])
        return (agree / power, agree**2 / power) if power > 0.0 else (0.0, 0.0)
