"""Where messages come from: a recording, or a robot that runs."""

from __future__ import annotations

import time
from pathlib import Path

from slopewise.models.errors import InputError
from slopewise.services.doctor.collect import (
    GRID_MAP,
    PATH,
    SPEED_LIMIT,
    TRANSFORMS,
    TYPES,
    Collector,
)
from slopewise.services.doctor.facts import Seen
from slopewise.services.io.bags import opened, read_cdr
from slopewise.services.io.files import fault
from slopewise.services.ros.settings import EdgeSettings

_NANO = 1e-9


def seen_in(bag: Path) -> Seen:
    """What a recording shows.

    Raises:
        InputError: no recording, or nothing in it that is looked at.
    """
    collector = Collector()
    with opened(bag) as recording:
        wanted = [c for c in recording.reader.connections if c.msgtype in TYPES]
        if not wanted:
            raise fault(bag, "topics", f"expected topics of {', '.join(TYPES)}, got none")
        for connection, at, raw in recording.raw(wanted):
            try:
                message = read_cdr(raw, connection.msgtype, bag, connection.topic)
            except InputError:
                continue  # one that is cut off says nothing; others do
            collector.take(connection.topic, connection.msgtype, message, _NANO * at)
    return collector.seen


def seen_live(edge: EdgeSettings, seconds: float) -> Seen:
    """What a robot that runs says for some time; nothing is said to it but that we listen.

    Raises:
        InputError: nobody is where the settings point.
    """
    import zenoh

    from slopewise.services.ros.conversions import ODOMETRY
    from slopewise.services.ros.inbox import decoded
    from slopewise.services.ros.node import Node
    from slopewise.services.settings.service_settings import ZenohSettings
    from slopewise.services.settings.zenoh_session import zenoh_config

    ours, topics, collector = edge.ros, edge.topics, Collector()
    place = ZenohSettings(mode="client", connect=ours.connect, config=ours.config)
    try:
        session = zenoh.open(zenoh_config(place))
    except zenoh.ZError:
        words = f"expected a router at {', '.join(ours.connect)}, got none"
        raise InputError("ros", "connect", words) from None
    listened = [(topics.odometry, ODOMETRY), (topics.speed_limit, SPEED_LIMIT)]
    listened += [(name, PATH) for name in topics.paths]
    listened += [(topics.map, GRID_MAP)] if topics.map else []
    listened += [(name, TRANSFORMS) for name in (topics.tf, topics.tf_static) if name]
    with (
        session,
        Node(
            session,
            ours.domain,
            ours.namespace,
            "slopewise_doctor",
            distribution=ours.distribution,
        ) as node,
    ):
        kinds = {
            node.subscribe(name, kind, latched=kind in (GRID_MAP, TRANSFORMS)): kind
            for name, kind in listened
        }
        node.inbox.all_of.update(kinds)
        offset, until = time.time() - time.monotonic(), time.monotonic() + seconds
        while time.monotonic() < until:
            node.follow()
            for topic, some in node.inbox.take(tuple(kinds), time.monotonic() + 0.1).items():
                for received in some:
                    message = decoded(node.inbox, topic, received, kinds[topic])
                    if message is not None:
                        collector.take(topic, kinds[topic], message, received.at + offset)
        missing = [audience.missing for audience in node.audiences() if audience.missing]
        refused = [f"{topic}: {why}" for topic, why in sorted(node.inbox.refused.items())]
    collector.seen.silence = [*missing, *refused]
    return collector.seen
