"""What the live page shows: the last plan, what was learned and found, and stops as they come.

Whoever plans or learns hands things in and goes on; nothing here waits, computes or grows without
end.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Lock

from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest

_REMEMBERED = 400
"""Stops, and changes of each group of parameters."""

_MOST_GROUPS = 64


@dataclass(frozen=True, slots=True)
class PlanSeen:
    """A question with its answer; ``at``: monotonic clock [s]."""

    request: PlanRequest
    reply: PlanReply
    at: float = field(default_factory=time.monotonic)


@dataclass(frozen=True, slots=True, kw_only=True)
class StopSeen:
    """A stop that was driven, beside what the parameters in use before it said.

    Attributes:
        speed: at its beginning [m/s]. grade: [rad]. predicted, actual: distance [m].
        surface: "" for the base. outcome: what learning made of it, in a word.
        version: of the parameters that predicted. at: wall clock [s].
    """

    speed: float
    grade: float
    predicted: float
    actual: float
    surface: str = ""
    outcome: str = ""
    version: int = 0
    at: float = field(default_factory=time.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSeen:
    """A group of parameters as it became.

    Attributes:
        group: its name. names: of its K parameters. value, std: (K,), std None where not known.
        valid: may be trusted. version: of all parameters. cause: who or what changed it.
        at: wall clock [s].
    """

    group: str
    names: Sequence[str]
    value: Sequence[float]
    std: Sequence[float | None]
    valid: bool
    version: int
    cause: str
    at: float = field(default_factory=time.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSeen:
    """Class of the ground now; ``probability`` of it, ``at``: wall clock [s]."""

    name: str
    probability: float
    at: float = field(default_factory=time.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingSeen:
    """The newest finding on stored stops, and what became of it.

    Attributes:
        offer: as it was found. state: `offered`, `adopted`, `reverted`, `refused`, or `nothing` to
            adopt. words: by whom, or why. purpose, command: what an operator types next, and what
            for; "" where nothing can be done.
    """

    offer: ModelProposal
    state: str
    words: str
    purpose: str = ""
    command: str = ""


class Board:
    """Handed to from any thread, read from any other.

    Attributes:
        changes: grows with everything but plans, so that a page knows when to look again.
    """

    def __init__(self) -> None:
        """Nothing yet."""
        self.changes = 0
        self._lock = Lock()
        self._plan: PlanSeen | None = None
        self._ground: GroundSeen | None = None
        self._finding: FindingSeen | None = None
        self._stops: deque[StopSeen] = deque(maxlen=_REMEMBERED)
        self._groups: dict[str, deque[GroupSeen]] = {}

    def planned(self, request: PlanRequest, reply: PlanReply) -> None:
        """A question was answered."""
        # A reference is swapped at once; no lock in the way of planning.
        self._plan = PlanSeen(request, reply)

    def stopped(self, stop: StopSeen) -> None:
        """A stop was driven."""
        with self._lock:
            self._stops.append(stop)
            self.changes += 1

    def learned(self, group: GroupSeen) -> None:
        """A group of parameters changed."""
        with self._lock:
            if group.group not in self._groups and len(self._groups) >= _MOST_GROUPS:
                return
            self._groups.setdefault(group.group, deque(maxlen=_REMEMBERED)).append(group)
            self.changes += 1

    def classified(self, ground: GroundSeen) -> None:
        """The ground was told."""
        with self._lock:
            self._ground = ground
            self.changes += 1

    def found(self, finding: FindingSeen | None) -> None:
        """There is a finding, or something became of it."""
        with self._lock:
            self._finding = finding
            self.changes += 1

    @property
    def plan(self) -> PlanSeen | None:
        """The last one."""
        return self._plan

    @property
    def ground(self) -> GroundSeen | None:
        """The last class of the ground."""
        return self._ground

    @property
    def finding(self) -> FindingSeen | None:
        """The newest one."""
        return self._finding

    def stops(self) -> list[StopSeen]:
        """Oldest first."""
        with self._lock:
            return list(self._stops)

    def groups(self) -> dict[str, list[GroupSeen]]:
        """The changes of each group, oldest first."""
        with self._lock:
            return {name: list(seen) for name, seen in self._groups.items()}
