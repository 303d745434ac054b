"""Inputs and output of the guard on zenoh's own keys, ``<namespace>/v1/guard/…``, and its messages.

All are in SI. Every message counts up for its sender, so that repeated and late ones are
recognised. ``time`` is the moment of measurement or sending on a clock of the sender [s]; without
it a delay that grows cannot be seen.
"""

from __future__ import annotations

from functools import partial
from typing import Any, TypeAlias

import zenoh
from msgspec import field

from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import Message, Name, NotNegative, Number


class GuardCommand(Message, frozen=True):
    """Command of the planner."""

    source: Name  # name of the sender
    sequence: Number  # number that increases with every message of it
    speed: float  # along the heading, forward positive [m/s]
    yaw_rate: float  # left positive [rad/s]
    time: float | None = None  # of sending, on the sender's clock [s]


class GuardMotion(Message, frozen=True):
    """Pose on the map, and speed."""

    source: Name  # source, sequence: as in a command
    sequence: Number
    x: float  # x, y: middle of the wheelbase [m]
    y: float
    heading: float  # left of the x axis of the map, of any number of turns [rad]
    speed: float  # along the heading, negative in reverse [m/s]
    time: float | None = None  # of measurement, on the sender's clock [s]
    yaw_rate: float = 0.0  # left positive [rad/s]


class GuardClear(Message, frozen=True):
    """Distance to which the path is known to be free."""

    source: Name  # source, sequence: as in a command
    sequence: Number
    distance: NotNegative  # of the middle of the wheelbase along its path [m]
    time: float | None = None  # of measurement, on the sender's clock [s]


class GuardConfirm(Message, frozen=True):
    """Pose that an operator confirms after a jump."""

    source: Name  # source, sequence: as in a command
    sequence: Number
    x: float  # x, y: middle of the wheelbase [m]
    y: float
    heading: float  # as in a motion [rad]


class GuardOutput(Message, frozen=True):
    """Command to the base."""

    source: Name  # source, sequence: process of the guard, and its count
    sequence: Number
    of: Number  # number of the command that is answered, 0 if none is
    speed: float  # as in a command [m/s]
    yaw_rate: float  # as in a command [rad/s]
    brake: bool  # brake as hard as possible, and hold
    action: str  # `pass`, `slow` or `stop`
    reason: str  # as text, empty where the command passes
    where: tuple[float, float] | None = None  # place on the map that limits it, if one does [m]


class GuardStatus(Message, frozen=True):
    """State of the guard.

    Attributes:
        stamps: by input that has come, what its stamps show of its age: `shared clock`, all of it;
            `growth only`, only how far it exceeds the smallest one seen; `none`, nothing
    """

    uptime: float  # since the start of the process [s]
    reaction: float  # time within which any single fault ends in a stop [s]
    counters: dict[str, int]  # events since the start
    ages: dict[str, float]  # age of each input [s], −1 of one that never came
    seconds: dict[str, float]  # median and 99th percentile of the duration of a decision [s]
    flags: list[str]  # active faults, human-readable
    last: str  # last reason to limit or stop
    stamps: dict[str, str] = field(default_factory=dict)


GuardInput: TypeAlias = tuple[Any, str, int | None, float | None]
"""Value as the feed of its kind takes it, sender, sequence, stamp on the sender's clock [s]."""

_MAX_BYTES = 4000
"""Size of a command, motion or clear distance: ten times that of the longest [bytes]."""

_KINDS: dict[str, type[Message]] = {
    "motion": GuardMotion,
    "clear": GuardClear,
    "command": GuardCommand,
    "confirm": GuardConfirm,
}
"""Inputs in the order in which they are used: a command with the newest motion."""


def format_of(raw: bytes) -> Format:
    """Format of a message: JSON is an object; MessagePack begins with no brace."""
    return Format.JSON if raw[:1] == b"{" else Format.MESSAGEPACK


class ZenohOutput:
    """Decisions on ``<namespace>/v1/guard/output``."""

    def __init__(self, session: zenoh.Session, namespace: str, source: str) -> None:
        """Publish as ``source``."""
        self._source, self._sequence = source, 0
        self._publisher = session.declare_publisher(
            f"{namespace}/v1/guard/output",
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
            priority=zenoh.Priority.REAL_TIME,
        )

    def send(self, decision: GuardDecision) -> None:
        """Send a decision to the base."""
        self._sequence += 1
        answer = decision._asdict()
        answer |= answer.pop("command")._asdict()
        message = GuardOutput(source=self._source, sequence=self._sequence, **answer)
        self._publisher.put(**codec.payload_of(message, Format.JSON))


class ZenohTransport(ZenohOutput):
    """Commands, motion, clear distance and confirmed poses in."""

    def __init__(self, session: zenoh.Session, namespace: str, inbox: Inbox) -> None:
        super().__init__(session, namespace, "guard")
        self.inbox = inbox
        self.topics = {name: name for name in _KINDS}
        inbox.all_of |= self.topics.keys()  # senders that alternate are seen by all messages
        self._subscribers = [
            session.declare_subscriber(f"{namespace}/v1/guard/{name}", partial(self._keep, name))
            for name in self.topics
        ]

    def _keep(self, name: str, sample: zenoh.Sample) -> None:
        if len(sample.payload) > _MAX_BYTES:
            self.inbox.refuse(name, f"expected at most {_MAX_BYTES} bytes")
        else:
            self.inbox.put(name, sample.payload.to_bytes())

    def read(self, topic: str, item: Received) -> GuardInput:
        """Decode a message."""
        encoding = codec.encoding_of(_KINDS[topic], format_of(item.raw))
        message: Any = codec.decode(_KINDS[topic], item.raw, encoding, topic, _MAX_BYTES)
        value: Any = message.distance if topic == "clear" else None
        if topic == "command":
            value = BaseCommand(message.speed, message.yaw_rate), message.sequence
        elif topic != "clear":
            value = Pose2d(message.x, message.y, message.heading)
        if topic == "motion":
            value = VehicleMotion(value, message.speed, message.yaw_rate)
        return value, message.source, message.sequence, getattr(message, "time", None)

    def close(self) -> None:
        """Unsubscribe."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
