"""Does the base do what it is told? Its speed against what it was allowed."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass(slots=True)
class Obedience:
    """Watches a speed against a limit that changes; one thread.

    A vehicle may be faster than a new limit for as long as its brakes need. What it must not be,
    for longer than ``patience``, is faster than every limit of that time, slowed at ``decel``.

    Attributes:
        dead_time: from a new limit to the brakes [s]. decel: that it brakes with at least [m/s²].
        spare: speed that does not count [m/s]. patience: time that does not count [s].
    """

    dead_time: float
    decel: float
    spare: float = 0.2
    patience: float = 0.3
    _limits: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=400))
    _expected: float = 0.0
    _at: float | None = None
    _since: float | None = None

    def told(self, limit: float, now: float) -> None:
        """A limit, from now on [m/s]."""
        self._limits.append((now, limit))

    def disobeys(self, speed: float, now: float) -> float:
        """By how much it is too fast [m/s]; 0 where it is not, or not for long enough."""
        reach = self.dead_time + self.patience
        # The last one before the span holds into it.
        while len(self._limits) > 1 and now - self._limits[1][0] > reach:
            self._limits.popleft()
        if not self._limits:
            return 0.0
        limit = max(limit for _, limit in self._limits)
        passed = 0.0 if self._at is None else max(now - self._at, 0.0)
        start = max(speed, limit) if self._at is None else self._expected
        self._expected, self._at = max(limit, start - self.decel * passed), now
        over = speed - self._expected - self.spare
        if over <= 0.0:
            self._since = None
            return 0.0
        self._since = now if self._since is None else self._since
        return over if now - self._since >= self.patience else 0.0
