"""Messages of a robot, from a recording or live, as the traffic that checks examine."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

from slopewise.models.errors import InputError
from slopewise.services.doctor.robot_facts import ObservedTraffic, TopicTraffic
from slopewise.services.io.bags import GRID_MAP, PATH, SPEED_LIMIT, opened, read_cdr
from slopewise.services.io.files import fault
from slopewise.services.ros.conversions import BOOL, ODOMETRY, TRANSFORMS
from slopewise.services.ros.settings import EdgeSettings

TYPES = (ODOMETRY, SPEED_LIMIT, BOOL, TRANSFORMS, PATH, GRID_MAP)  # Types that are collected
_NANO = 1e-9  # Seconds per nanosecond
_MAX_MESSAGES = 200_000  # Messages of a topic that are collected: over an hour at 50 Hz [1]
_WAIT = 0.1  # Time between updates of the keys that the robot uses [s]


class MessageCollector:
    """Takes one message after the other."""

    def __init__(self) -> None:
        """Begin without messages."""
        self.seen = ObservedTraffic()
        self._first: float | None = None

    def take(self, topic: str, kind: str, message: Any, at: float) -> None:
        """Record a message that was received ``at`` [s]."""
        self._first = at if self._first is None else self._first
        self.seen.span = at - self._first
        traffic = self.seen.topics.setdefault(topic, TopicTraffic(kind))
        if len(traffic.at) >= _MAX_MESSAGES:
            return
        traffic.at.append(at)
        header = getattr(message, "header", None)
        if header is not None:
            traffic.stamps.append(header.stamp.sec + _NANO * header.stamp.nanosec)
            if frame := header.frame_id.lstrip("/"):
                traffic.frames.add(frame)
        if kind == ODOMETRY:
            place, speed = message.pose.pose.position, message.twist.twist.linear.x
            if all(map(math.isfinite, (place.x, place.y, speed))):
                self.seen.odometry.append((at, place.x, place.y, speed))
        elif kind == SPEED_LIMIT:
            self.seen.limits.append((at, float(message.speed_limit), bool(message.percentage)))
        elif kind == TRANSFORMS:
            for link in message.transforms:
                child, parent = link.child_frame_id.lstrip("/"), link.header.frame_id.lstrip("/")
                self.seen.links[child] = parent


def recorded_traffic(bag: Path) -> ObservedTraffic:
    collector = MessageCollector()
    with opened(bag) as recording:
        connections = [c for c in recording.reader.connections if c.msgtype in TYPES]
        if not connections:
            raise fault(bag, "topics", f"expected topics of {', '.join(TYPES)}, got none")
        for connection, at, raw in recording.raw(connections):
            try:
                message = read_cdr(raw, connection.msgtype, bag, connection.topic)
            except InputError:
                continue  # one that is cut off carries no information; others do
            collector.take(connection.topic, connection.msgtype, message, _NANO * at)
    return collector.seen


def live_traffic(edge: EdgeSettings, seconds: float) -> ObservedTraffic:
    """Traffic of a running robot over a time [s]; nothing is sent but that we subscribe."""
    import zenoh

    from slopewise.services.ros.inbox import decoded
    from slopewise.services.ros.node import Node
    from slopewise.services.settings.service_settings import ZenohSettings
    from slopewise.services.settings.zenoh_session import zenoh_config

    ours, topics, collector = edge.ros, edge.topics, MessageCollector()
    place = ZenohSettings(mode="client", connect=ours.connect, config=ours.config)
    try:
        session = zenoh.open(zenoh_config(place))
    except zenoh.ZError:
        text = f"expected a router at {', '.join(ours.connect)}, got none"
        raise InputError("ros", "connect", text) from None
    subscribed = [(topics.odometry, ODOMETRY), (topics.speed_limit, SPEED_LIMIT)]
    subscribed += [(name, PATH) for name in topics.paths] + [(topics.map, GRID_MAP)]
    subscribed += [(name, TRANSFORMS) for name in (topics.tf, topics.tf_static)]
    name, distribution = "slopewise_doctor", ours.distribution
    with (
        session,
        Node(session, ours.domain, ours.namespace, name, distribution=distribution) as node,
    ):
        kinds = {
            node.subscribe(topic, kind, latched=kind in (GRID_MAP, TRANSFORMS)): kind
            for topic, kind in subscribed
            if topic
        }
        inbox = node.inbox
        inbox.all_of.update(kinds)
        offset, until = time.time() - time.monotonic(), time.monotonic() + seconds
        while time.monotonic() < until:
            node.follow()
            for topic, items in inbox.take(tuple(kinds), time.monotonic() + _WAIT).items():
                for item in items:
                    message = decoded(inbox, topic, item, kinds[topic])
                    if message is not None:
                        collector.take(topic, kinds[topic], message, item.at + offset)
        missing = [match.missing for match in node.matches() if match.missing]
        refused = [f"{topic}: {reason}" for topic, reason in sorted(inbox.refused.items())]
    collector.seen.silence = [*missing, *refused]
    return collector.seen
