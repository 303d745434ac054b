"""Logarithms of what the stretches of the last seconds measured, and their means.

Resistances vary by shares, so that their logarithms have like spreads on all grounds. Both rise
slowly with speed; f_r and turning thrust are taken at 0.3 m/s. Source: exponents are fits to
BorealTC, a Husky at 0.15–0.8 m/s. Omits: temperature, load.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from slopewise.models.terrain.observation import GroundObservation

REFERENCE_SPEED = 0.3
"""Rim speed that resistances are taken at [m/s]: the middle of BorealTC's drives."""
_EXPONENTS = {"motion": 0.20, "turning": 0.06, "lateral": 0.0, "slip": 0.0}
"""Fall of each quantity with rim speed, a power [1]."""
_FLOOR = 0.01
"""Value below which a resistance or slip track is not distinguished from another [1], [m]: half the
error of f_r on a slope, and below steel on rails plus that error."""


class Evidence(NamedTuple):
    """Logarithm of one quantity in one stretch.

    Attributes:
        end: time of the stretch's end [s]. quantity: `motion`, `turning`, `lateral`, or `slip`.
        log: natural logarithm of its value at the reference speed, with its variance.
    """

    end: float
    quantity: str
    log: float
    variance: float


class MeanEvidence(NamedTuple):
    """Mean logarithm of one quantity over stretches, and its variance."""

    log: float
    variance: float


def evidence_of(observation: GroundObservation) -> Iterator[Evidence]:
    """Evidence of one stretch: f_r of a straight, turning thrust, μ_t and B_s of a turn."""
    measured = observation.measured
    estimates = {
        "motion": measured.motion_resistance,
        "turning": observation.turning,
        "lateral": measured.lateral_resistance,
        "slip": measured.slip_track,
    }
    rim = max(observation.rim_speed, 0.1 * REFERENCE_SPEED)
    for quantity, estimate in estimates.items():
        if estimate.is_known:
            value = max(estimate.value, _FLOOR)
            log = math.log(value) + _EXPONENTS[quantity] * math.log(rim / REFERENCE_SPEED)
            yield Evidence(observation.end, quantity, log, (estimate.std / value) ** 2)


class EvidenceWindow:
    """Evidence of the last seconds of driving."""

    def __init__(self, seconds: float) -> None:
        """Begin without evidence; ``seconds``: its greatest age."""
        self._seconds = seconds
        self._entries: deque[Evidence] = deque()
        self.time = -math.inf

    def add(self, observation: GroundObservation) -> None:
        """Add a stretch, and drop what is too old at its end."""
        self.time = observation.end
        self._entries.extend(evidence_of(observation))
        self.expire(self.time)

    def expire(self, time: float) -> None:
        """Drop what is too old at a time [s]."""
        self.drop_before(time - self._seconds)

    def drop_before(self, time: float) -> None:
        """Drop stretches that ended before a time [s]."""
        while self._entries and self._entries[0].end < time:
            self._entries.popleft()

    def mean(self, quantity: str, since: float = -math.inf) -> MeanEvidence | None:
        """Mean logarithm of a quantity over stretches that ended since a time; None without any."""
        entries = [e for e in self._entries if e.quantity == quantity and e.end >= since]
        if not entries:
            return None
        count = len(entries)
        log = sum(entry.log for entry in entries) / count
        variance = sum(entry.variance for entry in entries) / count**2
        return MeanEvidence(log, variance)
