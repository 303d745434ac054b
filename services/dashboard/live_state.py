"""State of the live page: the last plan, parameters with their past, stops, terrain and finding.

Planning and learning hand in their messages and continue; nothing here waits, computes, or grows
without limit.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

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
    state: str  # offered, adopted, refused or nothing
    message: str  # who made it so, or why
    purpose: str = ""
    command: str = ""


@dataclass(slots=True)
class LiveState:
    """Written by planning and by learning, a thread each, and read by the page.

    Every value is replaced whole, so that no thread takes a lock.
    """

    changes: int = 0  # grows with everything but plans, so that a page reloads only what is new
    # last request with its reply, and the monotonic clock [s]
    plan: tuple[PlanRequest, PlanReply, float] | None = None
    # name and probability of the terrain, and the wall clock [s]
    ground: tuple[str, float, float] | None = None
    proposal: ProposalEntry | None = None  # newest finding
    # with the version of the parameters that predicted it, and the wall clock [s]; oldest first
    stops: tuple[tuple[LearnedStop, int, float], ...] = ()
    groups: Mapping[str, tuple[HistoryEntry, ...]] = field(default_factory=dict)  # oldest first

    def set_plan(self, request: PlanRequest, reply: PlanReply) -> None:
        self.plan = request, reply, time.monotonic()

    def set_ground(self, name: str, probability: float) -> None:
        self.ground = name, probability, time.time()
        self.changes += 1

    def set_proposal(self, proposal: ProposalEntry | None) -> None:
        self.proposal = proposal
        self.changes += 1

    def add_stop(self, stop: LearnedStop, version: int) -> None:
        self.stops = (*self.stops, (stop, version, time.time()))[-MAX_ENTRIES:]
        self.changes += 1

    def add_change(self, change: HistoryEntry) -> None:
        known = self.groups.get(change.group, ())
        if known or len(self.groups) < _MAX_GROUPS:
            self.groups = {**self.groups, change.group: (*known, change)[-MAX_ENTRIES:]}
            self.changes += 1
