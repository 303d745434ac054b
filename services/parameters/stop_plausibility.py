"""Plausibility of reported stops: consistent numbers, possible decelerations, a possible rate.

A stop is rejected where distance, speed, deceleration and dead time contradict each other, and
where the vehicle would have had to drive and brake faster than it can. Stops that only slow plans
down are never rejected for their rate: brakes may fail at any moment.
"""

from __future__ import annotations

import math

from slopewise.models.calibration.published import PublishSettings
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.models.vehicle import Vehicle
from slopewise.services.wire.observations import StopObservation

MAX_DEAD_TIME = 3.0
"""Longest dead time of a stop [s]: twice the longest that calibration accepts of brakes."""

_MAX_FORCE_RATIO = PublishSettings().most
_MIN_DECELERATION = 0.01
"""Below it, a stop from 1 m/s would take longer than 100 s [m/s²]."""

_DISTANCE_SHARE = 0.25
"""Accepted deviation of a distance from its other numbers [1]: speed and mean deceleration are
measured to some percent, and brakes build up."""

_DISTANCE_TOLERANCE = 0.15  # accepted deviation beyond the share [m]: a few samples at low speed
_HOLD_TIME = 1.0  # time for which the speed of a stop was held before it [s]


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


def deceleration_of(stop: StreamedStop) -> float:
    """Deceleration of a measured stop on its grade [m/s²]."""
    return GRAVITY * (stop.force_ratio + math.sin(stop.grade))


def implausible(stop: StreamedStop) -> str:
    """Reason why no brakes make a stop; empty if some do.

    Locked wheels are at rest immediately, and a push downhill is no brake: neither measures brakes.
    """
    if not 0.0 < stop.force_ratio <= _MAX_FORCE_RATIO:
        return f"F_b/W above 0 and at most {_MAX_FORCE_RATIO:g}, got {stop.force_ratio:.3g}"
    deceleration = deceleration_of(stop)
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
        deceleration = max(deceleration_of(stop), 0.1)
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
