"""State of the live page: the last plan, parameters with their past, stops, terrain and finding.

Planning and learning hand in their messages and continue; nothing here waits, computes, or grows
without limit.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from threading import Lock

from slopewise.services.parameters.stop_checks import LearnedStop
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.parameter_messages import HistoryEntry
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest

MAX_ENTRIES = 400  # stops, and changes of each group, on the page [1]: some hours of driving
_MAX_GROUPS = 64  # groups that the page shows [1]; bounds memory


@dataclass(frozen=True, slots=True)
class ProposalEntry:
    """The newest finding, its status, and the next step of an operator, "" for none."""

    offer: ModelProposal
    state: str  # offered, adopted, reverted, refused or nothing
    message: str  # who made it so, or why
    purpose: str = ""
    command: str = ""


class LiveState:
    """Written by planning and learning, read by the page; any thread."""

    def __init__(self) -> None:
        self.changes = 0  # grows with everything but plans, so that a page reloads only what is new
        # last request with its reply, and the monotonic clock [s]
        self.plan: tuple[PlanRequest, PlanReply, float] | None = None
        # name and probability of the terrain, and the wall clock [s]
        self.ground: tuple[str, float, float] | None = None
        self.proposal: ProposalEntry | None = None  # newest finding
        self._lock = Lock()
        self._stops: deque[tuple[LearnedStop, int, float]] = deque(maxlen=MAX_ENTRIES)
        self._groups: dict[str, deque[HistoryEntry]] = {}

    def set_plan(self, request: PlanRequest, reply: PlanReply) -> None:
        """Replace the last plan; a single assignment, so that planning takes no lock."""
        self.plan = request, reply, time.monotonic()

    def set_ground(self, name: str, probability: float) -> None:
        self.ground = name, probability, time.time()
        self._count()

    def set_proposal(self, proposal: ProposalEntry | None) -> None:
        self.proposal = proposal
        self._count()

    def add_stop(self, stop: LearnedStop, version: int) -> None:
        """Add a stop; ``version``: of the parameters that predicted it."""
        with self._lock:
            self._stops.append((stop, version, time.time()))
        self._count()

    def add_change(self, change: HistoryEntry) -> None:
        with self._lock:
            if change.group not in self._groups and len(self._groups) >= _MAX_GROUPS:
                return
            changes = self._groups.setdefault(change.group, deque(maxlen=MAX_ENTRIES))
            changes.append(change)
        self._count()

    def _count(self) -> None:
        with self._lock:
            self.changes += 1

    def stops(self) -> list[tuple[LearnedStop, int, float]]:
        """Stops with version and wall clock [s], oldest first."""
        with self._lock:
            return list(self._stops)

    def groups(self) -> list[list[HistoryEntry]]:
        """Changes of each group, oldest first."""
        with self._lock:
            return [list(changes) for changes in self._groups.values()]
