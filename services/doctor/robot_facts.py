"""Facts about a robot, from any source; unknown ones are None or empty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.services.ros.settings import EdgeSettings, Topics


class IssueSeverity(Enum):
    """Severity of an issue: with an error a plan may not be followed, or nothing works."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class ConfigIssue:
    """A setting or recording that does not fit."""

    severity: IssueSeverity
    check: str
    message: str
    fix: str


error = partial(ConfigIssue, IssueSeverity.ERROR)
warning = partial(ConfigIssue, IssueSeverity.WARNING)


@dataclass(frozen=True, slots=True)
class Nav2Facts:
    """Parameters of nodes by name, without namespaces; those of plugins are tables inside."""

    nodes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def of(self, node: str) -> Mapping[str, Any]:
        """Parameters of a node, empty if it is not there; those below ``/**`` are every node's."""
        return {**self.nodes.get("**", {}), **self.nodes.get(node, {})}

    def controllers(self) -> dict[str, Mapping[str, Any]]:
        """Path-following plugins by name; without a list Nav2 has one, FollowPath."""
        server = self.of("controller_server")
        listed = server.get("controller_plugins", ["FollowPath"])
        names = [n for n in listed if isinstance(n, str)] if isinstance(listed, list) else []
        return {name: table for name in names if (table := table_of(server, name))}

    def controller_rate(self) -> float | None:
        """Frequency of the controller [Hz]."""
        return first_number(self.of("controller_server").get("controller_frequency"))


def table_of(parameters: Mapping[str, Any], *names: str) -> Mapping[str, Any]:
    """The table inside others under these names, empty where it is missing."""
    for name in names:
        inside = parameters.get(name)
        parameters = inside if isinstance(inside, Mapping) else {}
    return parameters


def first_number(value: Any) -> float | None:
    """A number, or the first one of a list."""
    if isinstance(value, list) and value:
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        return None
    return float(value)


@dataclass(slots=True)
class TopicTraffic:
    """Messages of one topic."""

    kind: str
    at: list[float] = field(default_factory=list)  # times of reception [s]
    stamps: list[float] = field(default_factory=list)  # stamps of the headers [s]
    frames: set[str] = field(default_factory=set)

    @property
    def delay(self) -> float:
        """Median time from stamp to reception [s]."""
        return float(np.median(np.array(self.at[-len(self.stamps) :]) - self.stamps))

    @property
    def rate(self) -> float:
        """Messages per second; 0 below three of them."""
        span = self.at[-1] - self.at[0] if len(self.at) > 2 else 0.0
        return (len(self.at) - 1) / span if span > 0.0 else 0.0


@dataclass(slots=True)
class ObservedTraffic:
    """Messages of a robot, from a recording or live."""

    topics: dict[str, TopicTraffic] = field(default_factory=dict)
    span: float = 0.0  # from the first to the last message [s]
    odometry: list[tuple[float, float, float, float]] = field(default_factory=list)
    limits: list[tuple[float, float, bool]] = field(default_factory=list)
    """(t, limit [m/s], is a percentage) each."""
    links: dict[str, str] = field(default_factory=dict)
    silence: list[str] = field(default_factory=list)  # topics without a counterpart; live only


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """All facts; each part may be missing."""

    model: Model | None = None
    edge: EdgeSettings | None = None
    nav2: Nav2Facts = field(default_factory=Nav2Facts)
    seen: ObservedTraffic = field(default_factory=ObservedTraffic)
    ground: ElevationMap | None = None

    @property
    def topics(self) -> Topics:
        """Topics of the edge, else the default ones."""
        return Topics() if self.edge is None else self.edge.topics

    def traffic(self, topic: str) -> TopicTraffic:
        """Messages of a topic of the edge, without any if it was not seen."""
        return self.seen.topics.get(self.full_name(topic), TopicTraffic(""))

    def full_name(self, topic: str) -> str:
        """Topic with the namespace of the edge."""
        namespace = "" if self.edge is None else self.edge.ros.namespace.rstrip("/")
        return topic if topic.startswith("/") else f"{namespace}/{topic}"
