"""Stops from a stream of samples: constant time and memory per sample.

It is the pipeline of :mod:`slopewise.models.stop_logs.measured_log` for a robot whose log has no
end: each stop alone, and the measurement of :mod:`slopewise.models.stop_logs.onset` by running
sums. The sum v + g ∫ sin θ dt falls along a straight line whose slope is −g F_b/W, for any
change of the slope meanwhile. The line is taken from the dead time on until little speed is
left.

Validity: that of the onset. Near standstill the last samples are chosen by a noisy
speed: at 6 cm/s noise the force of a stop from 1 m/s comes out up to 2 % too low, which is the
safe side.
Source: Braking (1), (2), Sec. 4.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.drive_quality import max_fall
from slopewise.models.stop_logs.find_stops import STOP_COMMAND_MAX_SPEED

_HOLDING = 0.1  # [s] time constant of the mean of the held speed
_SETTLE = 0.05  # [s] after the dead time, before the line begins
_LITTLE = 0.15  # share of the held speed below which the line has ended
_MIN_SAMPLE_COUNT = 4  # of the line of a stop
_LONGEST_STEP = 0.5  # [s] a stop with a gap is discarded
_STANDING = 0.02  # [m/s]
_MIN_SPEED = 0.5  # [m/s] slower motion is ignored


@dataclass(frozen=True, slots=True)
class StreamedStop:
    """One stop as the stream measured it."""

    time: float  # of the stop command, on the clock of the samples [s]
    onset_speed: float  # [m/s]
    grade: float  # mean of the line [rad]
    force_ratio: float  # F_b/W
    force_std: float  # of it, by the residuals of the line
    dead_time: float  # from command to onset, by where the line meets the held speed [s]


class StopStream:
    """Feed samples in, get stops out.

    Args:
        dead_time: current estimate [s].
        mount: offset of the pitch sensor [rad]. dive: pitch under braking [rad s²/m].
    """

    def __init__(self, dead_time: float, *, mount: float = 0.0, dive: float = 0.0) -> None:
        self.dead_time, self.mount, self.dive = dead_time, mount, dive
        self._time = self._changed = self._speed = math.nan
        self._held = 0.0
        self._is_stop = True
        self._active = False
        self._command = self._pull = 0.0
        self._sums = [0.0] * 8  # count, t, w, tt, tw, ww, v, θ

    def feed(
        self, time: float, speed: float, command: float, pitch: float, grade: float = math.nan
    ) -> StreamedStop | None:
        """One sample, in SI units; the stop that it completes, if it does.

        Samples that do not come later than the one before are ignored. ``grade``: of the ground,
        from a map; NaN takes it from the pitch.
        """
        step = time - self._time
        if not (math.isfinite(time) and math.isfinite(speed) and math.isfinite(command)):
            self._active = False
            return None
        if step <= 0.0:
            return None
        self._time = time
        is_stop = command <= STOP_COMMAND_MAX_SPEED
        is_lost = self._is_step(time, speed)
        if not is_stop or not step <= _LONGEST_STEP or is_lost:
            self._active = False
        elif not self._is_stop:
            self._begin(time)
        self._is_stop = is_stop
        if not self._active:
            share = min(step / _HOLDING, 1.0) if step <= _LONGEST_STEP else 1.0
            self._held += share * (speed - self._held)
            return None
        return self._brake(time - self._command, step, speed, pitch, grade)

    def _is_step(self, time: float, speed: float) -> bool:
        """Return True if the speed has fallen faster than tyres and brakes can bring it down."""
        fall = abs(self._speed) - abs(speed)
        if fall == 0.0:
            return False
        is_step = bool(fall > max_fall(time - self._changed))
        self._changed, self._speed = time, speed
        return is_step

    def _begin(self, time: float) -> None:
        self._active = self._held >= _MIN_SPEED
        self._command, self._pull = time, 0.0
        self._sums = [0.0] * 8

    def _brake(
        self, since: float, step: float, speed: float, pitch: float, grade: float
    ) -> StreamedStop | None:
        theta = grade if grade == grade else self.mount - pitch
        if theta != theta:
            self._active = False
            return None
        self._pull += step * math.sin(theta)
        if speed <= _STANDING:
            self._active = False
            return self._finish()
        if since >= self.dead_time + _SETTLE and speed > _LITTLE * self._held:
            w = speed + GRAVITY * self._pull
            more = (1.0, since, w, since * since, since * w, w * w, speed, theta)
            self._sums = [a + b for a, b in zip(self._sums, more, strict=True)]
        return None

    def _finish(self) -> StreamedStop | None:
        n, t, w, tt, tw, ww, v, theta = self._sums
        held, self._held = self._held, 0.0
        if n < _MIN_SAMPLE_COUNT:
            return None
        middle, grade = t / n, theta / n
        power = tt - t * middle
        slope = (tw - w * middle) / power
        fall = slope - GRAVITY * math.sin(grade)
        if fall >= 0.0:
            return None
        left = max(ww - w * w / n - slope * slope * power, 0.0)
        std = math.sqrt(left / max(n - 2.0, 1.0) / power) / GRAVITY
        # The dive made the ground look steeper by as much as its deceleration.
        ground = grade - self.dive * fall
        force = -slope / GRAVITY - math.sin(ground) + math.sin(grade)
        onset = max(middle + (held - v / n) / fall, 0.0)
        return StreamedStop(self._command, held, ground, force, std, onset)
