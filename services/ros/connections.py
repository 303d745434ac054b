"""What diagnostics and log say of who hears us, and whom we hear."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence

from services.ros import conversions as ros
from services.ros.audience import Audience
from services.ros.conversions import Condition
from services.ros.graph import Speech

_log = logging.getLogger("slopewise")


class Connections:
    """Tells whenever somebody comes or goes who matters; one thread."""

    def __init__(self, needed: Collection[str]) -> None:
        """Warn if nobody is at the other end of topics ``needed``."""
        self._needed = frozenset(needed)
        self._last: dict[str, str] = {}
        self._told: dict[str, str] = {}

    def look(self, audiences: Sequence[Audience], speeches: Collection[Speech]) -> Condition:
        """The condition now; what lasts goes to the log once."""
        missing = {a.line.topic: a.missing for a in audiences if a.line.topic in self._needed}
        for topic, words in missing.items():
            # Two looks have to agree: tokens come one after the other.
            if self._last.get(topic) == words and self._told.get(topic, "") != words:
                self._told[topic] = words
                _log.warning("%s", words or f"{topic}: somebody is there now")
        self._last = missing
        said = [words for words in missing.values() if words]
        values = [(a.line.topic, a.missing or ", ".join(a.nodes)) for a in audiences]
        values.append(("speaks", "; ".join(s.value for s in speeches)))
        level = ros.WARN if said else ros.OK
        return Condition("connections", level, said[0] if said else "heard, and hearing", values)
