"""Who else is there: nodes, publishers and subscriptions of others, out of their tokens."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import zenoh

from slopewise.services.ros.naming import NO_HASH, NODE, PUBLISHER, SUBSCRIPTION, type_of

_MOST_TOKENS = 20_000
_ROS, _BRIDGE = "@ros2_lv", "@"


class Speech(Enum):
    """In which keys a robot speaks; the value is how to say it."""

    HASHED = "type hashes, as rmw_zenoh does since Jazzy"
    UNHASHED = "no type hashes, as rmw_zenoh of Humble does"
    BRIDGED = "keys of zenoh-bridge-ros2dds"


OF_DISTRIBUTION: dict[str, tuple[Speech, ...]] = {
    "auto": (Speech.HASHED,),
    "humble": (Speech.UNHASHED,),
    "jazzy": (Speech.HASHED,),
    "kilted": (Speech.HASHED,),
    "lyrical": (Speech.HASHED,),
    "dds": (Speech.BRIDGED,),
}
"""What each distribution speaks; with ``auto`` whatever else is seen is added."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A node, or a publisher or subscription of one.

    Attributes:
        entity: `naming.NODE`, `PUBLISHER`, `SUBSCRIPTION`, or that of a service.
        domain: ROS_DOMAIN_ID; None where a bridge speaks for it. session: zenoh's id.
        node: with its namespace; of a bridge, the bridge. topic, kind, type_hash: "" of nodes.
    """

    entity: str
    domain: int | None
    session: str
    node: str
    topic: str = ""
    kind: str = ""
    type_hash: str = ""

    @property
    def speech(self) -> Speech:
        """In which keys it speaks."""
        if self.domain is None:
            return Speech.BRIDGED
        return Speech.UNHASHED if self.type_hash == NO_HASH else Speech.HASHED


def endpoint_of(token: str) -> Endpoint | None:
    """What a token says; None if it is none of ROS 2. What follows the last known part is left."""
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
    """Endpoints of others as they come and go; zenoh's threads write, any thread reads.

    Attributes:
        domain: ours. changes: grows with everything that comes or goes.
    """

    def __init__(self, session: zenoh.Session, domain: int) -> None:
        """Watch, on a session whose own tokens do not count."""
        self.domain = domain
        self._own = str(session.info.zid())
        self._lock = threading.Lock()
        self._seen: dict[str, Endpoint] = {}
        self.changes = 0
        self._watchers = [
            session.liveliness().declare_subscriber(key, self._on_token, history=True)
            for key in (f"{_ROS}/*/**", f"{_BRIDGE}/*/{_ROS}/**")
        ]

    def close(self) -> None:
        """Watch no longer."""
        for watcher in self._watchers:
            watcher.undeclare()

    def _on_token(self, sample: Any) -> None:
        token = str(sample.key_expr)
        endpoint = endpoint_of(token)
        if endpoint is None or endpoint.session == self._own:
            return
        with self._lock:
            self.changes += 1
            if sample.kind != zenoh.SampleKind.PUT:
                self._seen.pop(token, None)
            elif len(self._seen) < _MOST_TOKENS:
                self._seen[token] = endpoint

    def all(self) -> list[Endpoint]:
        """Everything that is there now, of all domains."""
        with self._lock:
            return list(self._seen.values())

    def here(self) -> list[Endpoint]:
        """Publishers and subscriptions of our domain, or behind a bridge."""
        wanted = (PUBLISHER, SUBSCRIPTION)
        return [e for e in self.all() if e.entity in wanted and e.domain in (self.domain, None)]

    def speeches(self) -> set[Speech]:
        """In which keys those speak who are here."""
        return {e.speech for e in self.here()}


def others_domains(endpoints: Iterable[Endpoint], own: int) -> list[int]:
    """Domains of others that are not ours, sorted."""
    return sorted({e.domain for e in endpoints if e.domain is not None} - {own})
