"""Oscillation of the wheels' speed against the body's, from all stops of a log.

A sprung body pitches when the brakes take hold. Wheels read v_body − h · pitch rate, with the
height h of the body above its pitch axis: 0.1 m/s at the onset of soft springs, enough to make
brakes look early and the force depend on grade and speed. Where the log has the pitch rate, h is
all that is unknown; else the response is that of a damped oscillator to the deceleration.

Brakes that build up, or change while the vehicle slows, leave residuals of another shape: the
oscillation is taken out only where no such shape explains the stops as well.
Source: none; standard vehicle dynamics.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.onset import Knee, Oscillation, residuals
from slopewise.models.stop_logs.stop_record import StopSamples

_FREQUENCIES = 2.0 * np.pi * np.geomspace(0.6, 4.5, 12)
"""Tried first [rad/s]: pitch of vehicles on springs or tyres."""
_DAMPING = (0.1, 0.2, 0.35, 0.55, 0.8)
_BUILD_UP = (0.03, 0.06, 0.12, 0.25, 0.5)  # [s] time constants of brakes that are no oscillation
_MIN_GAIN = 40.0
"""Reduction of the squared residuals, in their variance, from which an oscillation is certain [1]:
six standard deviations, squared, and some more for what neighbouring samples share."""
_BETTER = 1.2
"""Reduction over that by other shapes from which it is an oscillation [1]: those with as many
numbers come within a hundredth of it where the body is rigid."""
_MAX_STOP_COUNT = 40
"""Stops that it is fitted to [1]: more cost time and sharpen it by less than its error."""
_MIN_STOP_COUNT = 5
_PASSES = 4
"""Gauss-Newton steps [1]: the third changes nothing that matters."""
_DIFFERENCE = 1e-3  # of the logarithms of gain and frequency, and of the damping, for derivatives
_LARGEST_STEP = 0.3  # of the same
_DAMPING_RANGE = 0.05, 0.95  # [1] of a body that swings at all, and does so several times

Refit = Callable[[int, Oscillation | None], Knee | None]
"""Fit of a stop, by its index, with an oscillation."""
Shape = Callable[[Floats], Floats] | None
"""Speed lost per deceleration, at times since the onset (n,) [s]; None: the pitch rate's."""


def oscillation_of(
    stops: Sequence[StopSamples], grounds: Sequence[Floats], refit: Refit
) -> Oscillation | None:
    """Oscillation that the stops share, None where they show none; grounds: (n,) grades [rad]."""
    chosen = range(0, len(stops), max(len(stops) // _MAX_STOP_COUNT, 1))
    if len(chosen) < _MIN_STOP_COUNT:
        return None

    def pool(oscillation: Oscillation | None) -> _Pool:
        return _Pool([(stops[i], refit(i, oscillation), grounds[i]) for i in chosen], oscillation)

    plain = pool(None)
    if all(s.pitch_rate is not None and np.isfinite(s.pitch_rate).all() for s in stops):
        return _by_pitch_rate(plain, pool)
    oscillations = [Oscillation(1.0, f, d) for f in _FREQUENCIES.tolist() for d in _DAMPING]
    sizes, reductions = plain.explained_alone([each.lead for each in oscillations])
    best = int(reductions.argmax())
    unrelated = max(plain.explained(shapes)[1] for shapes in _other_shapes())
    if sizes[best] <= 0.0 or reductions[best] < max(_MIN_GAIN, unrelated):
        return None
    oscillation = _refined(dataclasses.replace(oscillations[best], gain=float(sizes[best])), pool)
    return oscillation if plain.reduction(pool(oscillation)) > _BETTER * unrelated else None


def _other_shapes() -> list[list[Shape]]:
    """Brakes that build up, and decelerations that change during a stop."""

    def build_up(tau: float) -> Shape:
        return lambda since: -np.expm1(-np.maximum(since, 0.0) / tau)

    def power(n: int) -> Shape:
        return lambda since: np.maximum(since, 0.0) ** n

    changing = [[power(n) for n in range(2, last + 1)] for last in (2, 3, 4)]
    return [[build_up(tau)] for tau in _BUILD_UP] + changing


def _by_pitch_rate(plain: _Pool, pool: Callable[[Oscillation | None], _Pool]) -> Oscillation | None:
    """The oscillation as a height times the pitch rate of the log."""
    size, gain = plain.explained([None])
    height = size.item()
    if height <= 0.0 or gain < _MIN_GAIN:
        return None
    for _ in range(_PASSES):
        height = max(height + pool(Oscillation(height=height)).explained([None])[0].item(), 0.0)
    return Oscillation(height=height)


def _refined(oscillation: Oscillation, pool: Callable[[Oscillation | None], _Pool]) -> Oscillation:
    """The oscillation of least squares, the stops fitted again with each step."""
    x = np.array([np.log(oscillation.gain), np.log(oscillation.frequency), oscillation.damping])

    def at(x: Floats) -> Oscillation:
        gain, frequency = np.exp(x[:2]).tolist()
        return Oscillation(gain, frequency, float(np.clip(x[2], *_DAMPING_RANGE)))

    def shape_of(there: Oscillation, here: Oscillation) -> Shape:
        return lambda since: (there.lead(since) - here.lead(since)) / _DIFFERENCE

    for _ in range(_PASSES):
        shapes = [shape_of(at(x + _DIFFERENCE * unit), at(x)) for unit in np.eye(3)]
        x = x + np.clip(pool(at(x)).explained(shapes)[0], -_LARGEST_STEP, _LARGEST_STEP)
    return at(x)


class _Pool:
    """Residuals of several stops, each in its own noise."""

    def __init__(
        self,
        stops: Sequence[tuple[StopSamples, Knee | None, Floats]],
        oscillation: Oscillation | None,
    ) -> None:
        self.parts = []
        for stop, knee, ground in stops:
            if knee is None:
                continue
            new, rate = stop.fresh, stop.pitch_rate
            since, residual, follows = residuals(
                knee, stop.time[new], stop.of_body(oscillation)[new], ground[new], oscillation
            )
            slowing = GRAVITY * (knee.force_ratio + np.sin(knee.mean_grade))
            # Before the onset its rate is noise of the sensor alone.
            lost = None if rate is None else np.where(since > 0.0, -rate[new][: len(since)], 0.0)
            self.parts.append((since, residual / knee.rms, follows, -slowing, lost, knee.rms))

    def reduction(self, refitted: _Pool) -> float:
        """By how much less the squared residuals of other fits of the same stops are."""
        pairs = zip(self.parts, refitted.parts, strict=True)
        return sum(len(a[0]) * (1.0 - (b[-1] / a[-1]) ** 2) for a, b in pairs)

    def explained(self, shapes: Sequence[Shape]) -> tuple[Floats, float]:
        """Sizes (k,) of shapes in all stops, and their reduction of the squared residuals."""
        normal, right = np.zeros((len(shapes), len(shapes))), np.zeros(len(shapes))
        for columns, residual in self._columns(shapes):
            normal += columns.T @ columns
            right += columns.T @ residual
        sizes = np.asarray(np.linalg.lstsq(normal, right, rcond=1e-9)[0], np.float64)
        return sizes, float(sizes @ right)

    def explained_alone(self, shapes: Sequence[Shape]) -> tuple[Floats, Floats]:
        """Sizes (k,) of shapes of which only one is in all stops, and (k,) what each reduces."""
        normal, right = np.full(len(shapes), 1e-300), np.zeros(len(shapes))
        for columns, residual in self._columns(shapes):
            normal += np.einsum("nk,nk->k", columns, columns)
            right += columns.T @ residual
        sizes: Floats = right / normal
        return sizes, sizes * right

    def _columns(self, shapes: Sequence[Shape]) -> Iterator[tuple[Floats, Floats]]:
        """(n, k) shapes of each stop that its fit does not follow, and (n,) its residuals."""
        for since, residual, follows, slowing, lost, rms in self.parts:
            columns = np.array([lost if s is None else slowing * s(since) for s in shapes]).T / rms
            yield columns - follows @ (follows.T @ columns), residual
