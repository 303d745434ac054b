"""Comparison of a base's speed with the limits that it received."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

_MAX_LIMITS = 400  # limits that are stored: 4 s at 100 Hz, more than brakes need to act [1]


@dataclass(slots=True)
class OverspeedMonitor:
    """Compares a speed with a limit that changes; one thread.

    A vehicle may exceed a new limit for as long as its brakes need. It must not, for longer than
    ``patience``, exceed every limit of that time and the deceleration ``decel``.
    """

    dead_time: float  # from a new limit to the brakes [s]
    decel: float  # lowest deceleration of the brakes [m/s²]
    tolerance: float = 0.2  # excess of speed that is ignored, of noise and slip [m/s]
    patience: float = 0.3  # duration of an excess that is ignored, of single samples [s]
    _limits: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_MAX_LIMITS))
    _expected: float = 0.0
    _at: float | None = None
    _since: float | None = None

    def set_limit(self, limit: float, now: float) -> None:
        """Record a limit that holds from now on [m/s]."""
        self._limits.append((now, limit))

    def overspeed(self, speed: float, now: float) -> float:
        """Excess of speed [m/s], 0 without one or before it has lasted long enough."""
        reach = self.dead_time + self.patience
        # The last limit before the span holds into it.
        while len(self._limits) > 1 and now - self._limits[1][0] > reach:
            self._limits.popleft()
        if not self._limits:
            return 0.0
        limit = max(limit for _, limit in self._limits)
        passed = 0.0 if self._at is None else max(now - self._at, 0.0)
        start = max(speed, limit) if self._at is None else self._expected
        self._expected, self._at = max(limit, start - self.decel * passed), now
        excess = speed - self._expected - self.tolerance
        if excess <= 0.0:
            self._since = None
            return 0.0
        self._since = now if self._since is None else self._since
        return excess if now - self._since >= self.patience else 0.0
