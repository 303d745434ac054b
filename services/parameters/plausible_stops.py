"""Which reported stops can have happened: their numbers agree, and there was time for them.

A stop is a lie or a mistake where its distance, speed, deceleration and dead time contradict each
other, and where the vehicle would have had to drive and brake faster than it can. What only slows
plans down is not held up by the second: brakes may fail at any moment.
"""

from __future__ import annotations

import math

from slopewise.models.vehicle import Vehicle
from slopewise.services.wire.observations import StopObservation

MIN_DECELERATION = 0.01
"""What slows less is no stop: from 1 m/s it would take longer than 100 s [m/s²]."""

_SHARE = 0.25
_METRES = 0.15
"""By so much a distance may differ from what speed, deceleration and dead time come to."""

_MOST_DEAD_TIME = 3.0
_AT_SPEED = 1.0
"""A speed that a stop begins with was held for so long [s]."""


def contradiction(one: StopObservation) -> str:
    """Why the numbers of a stop do not fit each other; empty if they do."""
    if one.distance is None:
        return ""
    braking = one.speed**2 / (2.0 * one.deceleration)
    least = most = braking
    if one.dead_time is None:
        most += one.speed * _MOST_DEAD_TIME
    else:
        least = most = braking + one.speed * one.dead_time
    # The mean deceleration is known as well as its sender says, three standard deviations at most.
    share = _SHARE + min(3.0 * one.deceleration_std / one.deceleration, _SHARE)
    least, most = least * (1.0 - share) - _METRES, most * (1.0 + share) + _METRES
    if least <= one.distance <= most:
        return ""
    words = f"{max(least, 0.0):.2f} … {most:.2f} m by speed, deceleration and dead time"
    return f"distance: expected {words}, got {one.distance:.2f}"


class StopPace:
    """No more stops in a time than the vehicle can make; one thread."""

    def __init__(self, vehicle: Vehicle, at_once: float) -> None:
        """Let ``at_once`` stops come together, as a sender delivers what it had stored."""
        self._accel = vehicle.max_drive_force / vehicle.mass
        self._at_once = self._left = float(at_once)
        self._at = -math.inf

    def takes(self, speed: float, deceleration: float, dead_time: float) -> float:
        """Time in which a stop from ``speed`` [m/s] can be made again [s]."""
        late = dead_time if dead_time > 0.0 else 0.0
        return _AT_SPEED + speed / self._accel + late + speed / deceleration

    def room(self, seconds: float, at: float) -> bool:
        """Whether a stop that takes so long can have happened by ``at`` [s]; it counts if so."""
        passed = max(at - self._at, 0.0)
        self._at = max(self._at, at)
        self._left = min(self._left + passed / seconds, self._at_once)
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
