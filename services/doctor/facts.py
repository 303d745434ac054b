"""What is known of a robot, wherever it is from; what is not known is None or empty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from slopewise.models.parameters import Model
from slopewise.services.ros.settings import EdgeSettings


class MisfitSeverity(Enum):
    """How bad a finding is."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Misfit:
    """What does not fit.

    Attributes:
        check: name of the check. severity: error where a plan may not be kept, or nothing works.
        words: what, where, by how much. remedy: what to do about it.
    """

    check: str
    severity: MisfitSeverity
    words: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Nav2Facts:
    """Parameters of nodes by name, without namespaces; those of plugins are tables inside."""

    nodes: Mapping[str, Mapping[str, Any]]
    source: str = ""

    def of(self, node: str) -> Mapping[str, Any]:
        """Parameters of a node, none if it is not there."""
        return self.nodes.get(node, {})

    def controllers(self) -> dict[str, Mapping[str, Any]]:
        """Path-following plugins by name."""
        server = self.of("controller_server")
        names = server.get("controller_plugins", [])
        found = {name: server.get(name, {}) for name in names if isinstance(name, str)}
        return {name: table for name, table in found.items() if isinstance(table, Mapping)}


@dataclass(slots=True)
class TopicSeen:
    """Messages of one topic.

    Attributes:
        kind: type. at: when each was received [s]. stamps: of their headers [s]. frames: likewise.
    """

    kind: str
    at: list[float] = field(default_factory=list)
    stamps: list[float] = field(default_factory=list)
    frames: set[str] = field(default_factory=set)

    @property
    def rate(self) -> float:
        """Messages a second; 0 below three of them."""
        span = self.at[-1] - self.at[0] if len(self.at) > 2 else 0.0
        return (len(self.at) - 1) / span if span > 0.0 else 0.0


@dataclass(slots=True)
class Seen:
    """What a robot was seen to do, from a recording or live.

    Attributes:
        topics: by name. span: from the first to the last message [s].
        odometry: (t, x, y, v). limits: (t, limit [m/s], percentage). stops: (t, stop).
        links: of /tf: child frame to parent.
        silence: what nobody hears or says, in words; live only.
    """

    topics: dict[str, TopicSeen] = field(default_factory=dict)
    span: float = 0.0
    odometry: list[tuple[float, float, float, float]] = field(default_factory=list)
    limits: list[tuple[float, float, bool]] = field(default_factory=list)
    stops: list[tuple[float, bool]] = field(default_factory=list)
    links: dict[str, str] = field(default_factory=dict)
    silence: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Facts:
    """Everything that is known; each part may be missing."""

    model: Model | None = None
    edge: EdgeSettings | None = None
    nav2: Nav2Facts | None = None
    seen: Seen | None = None
