"""Nodes, publishers and subscriptions of others, from their liveliness tokens."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import Enum
from typing import Any

import zenoh

from slopewise.services.ros.naming import NO_HASH, NODE, PUBLISHER, SUBSCRIPTION, type_of

_MAX_TOKENS = 20_000  # Tokens that are stored; a fleet of 100 robots has some 10,000 [1]

_ROS, _BRIDGE = "@ros2_lv", "@"


class KeyScheme(Enum):
    """Scheme of the keys that a robot uses; the value describes it."""

    HASHED = "type hashes, as rmw_zenoh does since Jazzy"
    UNHASHED = "no type hashes, as rmw_zenoh of Humble does"
    BRIDGED = "keys of zenoh-bridge-ros2dds"


OF_DISTRIBUTION: dict[str, KeyScheme] = {
    "auto": KeyScheme.HASHED,
    "humble": KeyScheme.UNHASHED,
    "jazzy": KeyScheme.HASHED,
    "kilted": KeyScheme.HASHED,
    "lyrical": KeyScheme.HASHED,
    "dds": KeyScheme.BRIDGED,
}
"""Scheme of each distribution; with ``auto`` others that are seen are added."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Node, or a publisher or subscription of one; nodes have no topic, kind or hash."""

    entity: str  # `naming.NODE`, `PUBLISHER`, `SUBSCRIPTION`, or that of a service
    domain: int | None  # ROS_DOMAIN_ID; None behind a bridge
    session: str
    node: str  # with its namespace; behind a bridge, the bridge
    topic: str = ""
    kind: str = ""
    type_hash: str = ""

    @property
    def scheme(self) -> KeyScheme:
        if self.domain is None:
            return KeyScheme.BRIDGED
        return KeyScheme.UNHASHED if self.type_hash == NO_HASH else KeyScheme.HASHED


def endpoint_of(token: str) -> Endpoint | None:
    """Endpoint that a token declares, None if it is not of ROS 2; unknown parts are ignored."""
    parts = token.split("/")
    if parts[0] == _ROS and len(parts) >= 9 and parts[1].isdecimal():
        _, domain, session, _, _, entity, _, namespace, name, *topic = parts
        node = f"{namespace.replace('%', '/').rstrip('/')}/{name}"
        if entity == NODE:
            return Endpoint(entity, int(domain), session, node)
        if len(topic) < 3:
            return None
        named, kind, type_hash = topic[0].replace("%", "/"), type_of(topic[1]), topic[2]
        return Endpoint(entity, int(domain), session, node, named, kind, type_hash)
    if parts[0] == _BRIDGE and len(parts) >= 6 and parts[2] == _ROS:
        _, session, _, entity, key, kind = parts[:6]
        topic_name = "/" + key.replace("§", "/").lstrip("/")
        bridge = f"zenoh-bridge-ros2dds {session[:8]}"
        return Endpoint(entity, None, session, bridge, topic_name, kind.replace("§", "/"))
    return None


class Graph:
    """Endpoints of others as they come and go; zenoh's threads write, any thread reads."""

    def __init__(self, session: zenoh.Session, domain: int) -> None:
        """Subscribe on a session whose tokens are ignored."""
        self.domain = domain
        self._session_id = str(session.info.zid())
        self._lock = threading.Lock()
        self._endpoints: dict[str, Endpoint] = {}
        self.changes = 0
        self._watchers = [
            session.liveliness().declare_subscriber(key, self._on_token, history=True)
            for key in (f"{_ROS}/*/**", f"{_BRIDGE}/*/{_ROS}/**")
        ]

    def close(self) -> None:
        for watcher in self._watchers:
            watcher.undeclare()

    def _on_token(self, sample: Any) -> None:
        token = str(sample.key_expr)
        endpoint = endpoint_of(token)
        if endpoint is None or endpoint.session == self._session_id:
            return
        with self._lock:
            self.changes += 1
            if sample.kind != zenoh.SampleKind.PUT:
                self._endpoints.pop(token, None)
            elif len(self._endpoints) < _MAX_TOKENS:
                self._endpoints[token] = endpoint

    def all(self) -> list[Endpoint]:
        """Endpoints of all domains."""
        with self._lock:
            return list(self._endpoints.values())

    def here(self) -> list[Endpoint]:
        """Publishers and subscriptions of our domain, or behind a bridge."""
        kinds = (PUBLISHER, SUBSCRIPTION)
        return [e for e in self.all() if e.entity in kinds and e.domain in (self.domain, None)]

    def schemes(self) -> set[KeyScheme]:
        """Schemes in use here."""
        return {e.scheme for e in self.here()}
