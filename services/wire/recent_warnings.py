"""Warnings about recent events, each active for a limited time."""

from __future__ import annotations

import time

_MAX_WARNINGS = 8  # warnings at the same time [1]: a sender of bad messages cannot fill the status
_DURATION = 600.0  # time for which a warning stays active [s]: an operator looks every few minutes


class RecentWarnings:
    """Texts with the time of the last occasion; one thread writes, any thread reads."""

    def __init__(self, duration: float = _DURATION) -> None:
        """Keep each warning active for a duration [s]."""
        self._duration = duration
        self._times: dict[str, float] = {}

    def add(self, text: str) -> None:
        """Add a warning, or extend it."""
        # Each keeps its position, so that the list changes no more often than its content.
        times = {**self._times, text: time.monotonic()}
        while len(times) > _MAX_WARNINGS:
            del times[min(times, key=times.__getitem__)]
        # Replaced as a whole: other threads may read in the meantime.
        self._times = times

    def clear(self, text: str) -> None:
        """Remove a warning whose cause is gone."""
        self._times = {t: at for t, at in self._times.items() if t != text}

    def active(self) -> list[str]:
        """Active warnings; from any thread."""
        start = time.monotonic() - self._duration
        return [text for text, at in self._times.items() if at > start]
