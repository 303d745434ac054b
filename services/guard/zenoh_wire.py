"""The guard on zenoh's own keys: ``<namespace>/v1/guard/…``, beside the map and the parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.guard.arc import PlanarPose
from slopewise.services.guard.core import BaseWord, Guard
from slopewise.services.guard.decide import BaseCommand, VehicleMotion
from slopewise.services.guard.feed import Feed
from slopewise.services.guard.messages import GuardClear, GuardCommand, GuardMotion, GuardOutput
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format

_SMALL = 4000
_DROP = zenoh.CongestionControl.DROP


class Wire(Protocol):
    """How commands and motion come, and the word goes out."""

    inbox: Inbox
    topics: tuple[str, ...]

    def take(self, guard: Guard, found: dict[str, list[Received]]) -> bool:
        """Hand over what came; whether a command is among it."""

    def say(self, word: BaseWord) -> None:
        """Tell the base."""

    def close(self) -> None:
        """Leave."""


def format_of(raw: bytes) -> Format:
    """JSON of a message is an object; MessagePack begins with no brace."""
    return Format.JSON if raw[:1] == b"{" else Format.MESSAGEPACK


def decoded(kind: Any, received: Received, source: str) -> Any:
    """A message out of the inbox.

    Raises:
        InputError: names key and field.
    """
    encoding = codec.encoding_of(kind, format_of(received.raw))
    return codec.decode(kind, received.raw, encoding, source, _SMALL)


class OutputWire:
    """Words to the base on ``<namespace>/v1/guard/output``."""

    def __init__(self, session: zenoh.Session, namespace: str, source: str) -> None:
        """Speak as ``source``."""
        self._source, self._sequence = source, 0
        self._publisher = session.declare_publisher(
            f"{namespace}/v1/guard/output",
            congestion_control=_DROP,
            express=True,
            priority=zenoh.Priority.REAL_TIME,
        )

    def say(self, word: BaseWord) -> None:
        """Tell the base."""
        self._sequence += 1
        decision = word.decision
        message = GuardOutput(
            source=self._source,
            sequence=self._sequence,
            of=word.of,
            speed=decision.command.speed,
            yaw_rate=decision.command.yaw_rate,
            brake=decision.brake,
            action=decision.action,
            reason=decision.reason,
        )
        encoding = codec.encoding_of(GuardOutput, Format.JSON)
        self._publisher.put(codec.encode(message, Format.JSON), encoding=encoding)


class ZenohWire(OutputWire):
    """Commands, motion and clear distance in."""

    def __init__(self, session: zenoh.Session, namespace: str, inbox: Inbox) -> None:
        """Listen."""
        super().__init__(session, namespace, "guard")
        self.inbox = inbox
        self.topics: tuple[str, ...] = ("command", "motion", "clear")
        self._subscribers = [
            session.declare_subscriber(f"{namespace}/v1/guard/{name}", self._keeper(name))
            for name in self.topics
        ]

    def _keeper(self, name: str) -> Callable[[zenoh.Sample], None]:
        def on_sample(sample: zenoh.Sample) -> None:
            if len(sample.payload) > _SMALL:
                self.inbox.refuse(name, f"expected at most {_SMALL} bytes")
                return
            self.inbox.put(name, sample.payload.to_bytes())

        return on_sample

    def take(self, guard: Guard, found: dict[str, list[Received]]) -> bool:
        """Hand over what came; whether a command is among it."""
        commanded = False
        for name in ("motion", "clear", "command"):
            for received in found.get(name, ()):
                try:
                    commanded |= self._take(guard, name, received)
                except InputError as error:
                    # A command or a place that cannot be read takes away the one before it.
                    feeds: dict[str, Feed[Any]] = {"motion": guard.motions, "clear": guard.clears}
                    feeds.get(name, guard.commands).drop(at=received.at)
                    self.inbox.refuse(name, str(error))
        return commanded

    def _take(self, guard: Guard, name: str, received: Received) -> bool:
        if name == "motion":
            m = decoded(GuardMotion, received, name)
            motion = VehicleMotion(PlanarPose(m.x, m.y, m.heading), m.speed)
            guard.motions.take(motion, received.at, m.source, m.sequence, m.time)
        elif name == "clear":
            c = decoded(GuardClear, received, name)
            guard.clear(c.distance, received.at, c.source, c.sequence, c.time)
        else:
            k = decoded(GuardCommand, received, name)
            command = BaseCommand(k.speed, k.yaw_rate), k.sequence
            return guard.commands.take(command, received.at, k.source, k.sequence, k.time)
        return False

    def close(self) -> None:
        """Leave."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
