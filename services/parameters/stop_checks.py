"""Stops before they are learned from: found in samples, plausible, compared with a prediction.

A stop is rejected where distance, speed, deceleration and dead time contradict each other, and
where the vehicle would have had to drive and brake faster than it can. Stops that only slow plans
down are never rejected for their rate: brakes may fail at any moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.effects.registry import LAWS
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from slopewise.models.vehicle import Vehicle
from slopewise.services.wire.observations import StopObservation

MAX_DEAD_TIME = 3.0
"""Longest dead time of a stop [s]: twice the longest that calibration accepts of brakes."""

_MAX_FORCE_RATIO = PublishSettings().max_force
_MIN_DECELERATION = 0.01  # below it, a stop from 1 m/s would take longer than 100 s [m/s²]
_DISTANCE_SHARE = 0.25
"""Accepted deviation of a distance from its other numbers [1]: speed and mean deceleration are
measured to some percent, and brakes build up."""

_DISTANCE_TOLERANCE = 0.15  # accepted deviation beyond the share [m]: a few samples at low speed
_HOLD_TIME = 1.0  # time for which the speed of a stop was held before it [s]


@dataclass(frozen=True, slots=True)
class LearnedStop:
    """A stop and the prediction from before it was learned from."""

    surface: str
    speed: float  # at the stop command [m/s]
    grade: float  # [rad]
    predicted: float  # distance from command to rest on a uniform slope [m]
    actual: float  # the same, measured [m]
    outcome: str  # result of the update, one word


def predicted_distance(used: Braking, dead_time: float, stop: StreamedStop) -> float:
    """Distance of a stop by a braking model, with brakes that respond after a dead time [m]."""
    force = braking.force_ratio(stop.grade, stop.onset_speed, *used.coefficients)
    deceleration = braking.deceleration(force, stop.grade)
    if not deceleration > 0.0:
        return math.inf
    dead_time = max(used.dead_time, dead_time)
    return float(
        braking.stopping_distance(stop.onset_speed, deceleration, dead_time, used.distance_offset)
    )


def measured_distance(stop: StreamedStop, dead_time: float) -> float:
    """Distance of a measured stop; ``dead_time`` [s] is used where it was not measured [m]."""
    dead_time = dead_time if math.isnan(stop.dead_time) else stop.dead_time
    return stop.onset_speed * dead_time + stop.onset_speed**2 / (2.0 * _deceleration_of(stop))


def _deceleration_of(stop: StreamedStop) -> float:
    """Deceleration of a measured stop on its grade [m/s²]."""
    return GRAVITY * (stop.force_ratio + math.sin(stop.grade))


def unsupported_reason(model: Model, owner: str = "the model file") -> str:
    """Reason why braking cannot be learned on top of a model of ``owner``; empty if it can.

    Stops measure the force with all that helps to brake. Force that the model adds as an effect, or
    holds separately, would be counted twice; effects that only reduce it make plans slower.
    """
    if model.braking.uphill is not None:
        return f"braking is not learned: {owner} has separate uphill coefficients"
    if model.braking.level < 1.0:
        return f"braking is not learned: {owner} is of a brake level below 1"
    more = [e.name for e in model.effect if not LAWS[e.name].only_reduces(e.parameters)]
    return f"braking is not learned: {owner} has the effect {more[0]}" if more else ""


def counts_twice(model: Model) -> bool:
    """Return True if learned force holds force that the model's effects add already."""
    adds_force = any(LAWS[effect.name].adds(effect.parameters) for effect in model.effect)
    return adds_force and bool(unsupported_reason(model))


def contradiction(stop: StopObservation) -> str:
    """Contradiction between the numbers of a stop; empty if they agree."""
    if stop.distance is None:
        return ""
    lower = upper = stop.speed**2 / (2.0 * stop.deceleration)
    if stop.dead_time is None:
        upper += stop.speed * MAX_DEAD_TIME
    else:
        lower = upper = lower + stop.speed * stop.dead_time
    # The mean deceleration is as certain as its sender reports, three standard deviations at most.
    deviation = 3.0 * stop.deceleration_std / stop.deceleration
    share = _DISTANCE_SHARE + min(deviation, _DISTANCE_SHARE)
    lower = lower * (1.0 - share) - _DISTANCE_TOLERANCE
    upper = upper * (1.0 + share) + _DISTANCE_TOLERANCE
    if lower <= stop.distance <= upper:
        return ""
    expected = f"{max(lower, 0.0):.2f} … {upper:.2f} m by speed, deceleration and dead time"
    return f"distance: expected {expected}, got {stop.distance:.2f}"


def implausible(stop: StreamedStop) -> str:
    """Reason why no brakes make a stop; empty if some do.

    Locked wheels are at rest immediately, and a push downhill is no brake: neither measures brakes.
    """
    if not 0.0 < stop.force_ratio <= _MAX_FORCE_RATIO:
        return f"F_b/W above 0 and at most {_MAX_FORCE_RATIO:g}, got {stop.force_ratio:.3g}"
    deceleration = _deceleration_of(stop)
    if not deceleration >= _MIN_DECELERATION:
        return f"a deceleration of at least {_MIN_DECELERATION:g} m/s², got {deceleration:.3g}"
    return ""


class StopRateLimiter:
    """Accepts stops only as fast as the vehicle can make them; one thread."""

    def __init__(self, vehicle: Vehicle, burst: float) -> None:
        """Accept ``burst`` stops together, as a sender delivers stored ones."""
        self._accel = vehicle.max_drive_force / vehicle.mass
        self._burst = self._credit = float(burst)
        self._at = -math.inf

    def accepts(self, stop: StreamedStop, at: float) -> bool:
        """Return True if a stop can have happened by ``at`` [s]; it is then counted."""
        deceleration = max(_deceleration_of(stop), 0.1)
        dead_time = stop.dead_time if stop.dead_time > 0.0 else 0.0
        duration = _HOLD_TIME + stop.onset_speed / self._accel + dead_time
        duration += stop.onset_speed / deceleration
        passed = max(at - self._at, 0.0)
        self._at = max(self._at, at)
        self._credit = min(self._credit + passed / duration, self._burst)
        if self._credit < 1.0:
            return False
        self._credit -= 1.0
        return True


def stops_in(
    stream: StopStream, columns: Mapping[str, Floats], dead_time: float
) -> Iterator[StreamedStop]:
    """Stops that end in samples, (n,) each; late brakes, ``dead_time`` [s], are not weak."""
    stream.dead_time = dead_time
    unknown = np.full_like(columns["t"], np.nan)
    names = ("t", "v", "v_cmd", "pitch", "grade")
    rows = [columns.get(name, unknown).tolist() for name in names]
    return filter(None, map(stream.feed, *rows))
