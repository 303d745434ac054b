"""Messages to and from the guard where ROS 2 is not used; SI, as all messages of the service.

Every message counts up for its sender, so that repeated and late ones are recognised. ``time`` is
the moment of measurement or sending on a clock of the sender [s]; without it a delay that grows
cannot be seen.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from msgspec import field

from slopewise.services.wire.plan_messages import Message, Name, NotNegative, Number


class GuardCommand(Message, frozen=True):
    """Command of the planner: speed [m/s], forward positive; yaw rate [rad/s]."""

    source: Name
    sequence: Number
    speed: float
    yaw_rate: float
    time: float | None = None


class GuardMotion(Message, frozen=True):
    """Middle of the wheelbase on the map [m], heading [rad], speed [m/s], yaw rate [rad/s]."""

    source: Name
    sequence: Number
    x: float
    y: float
    heading: float
    speed: float
    time: float | None = None
    yaw_rate: float = 0.0


class GuardClear(Message, frozen=True):
    """Distance to which the path of the middle of the wheelbase is known to be free [m]."""

    source: Name
    sequence: Number
    distance: NotNegative
    time: float | None = None


class GuardOutput(Message, frozen=True):
    """Command to the base."""

    source: Name  # source, sequence: process of the guard, and its count
    sequence: Number
    of: Number  # number of the command that is answered, 0 if none is
    speed: float  # speed, yaw_rate: as in a command [m/s], [rad/s]
    yaw_rate: float
    brake: bool  # brake as hard as possible, and hold
    action: str  # `pass`, `slow` or `stop`
    reason: str  # as text, empty where the command passes
    where: tuple[float, float] | None = None  # place on the map that limits it, if one does [m]


class GuardStatus(Message, frozen=True):
    """State of the guard."""

    uptime: float  # since the start of the process [s]
    reaction: float  # time within which any single fault ends in a stop [s]
    counters: dict[str, int]  # events since the start
    ages: dict[str, float]  # age of each input [s], −1 of one that never came
    seconds: dict[str, float]  # median and 99th percentile of the duration of a decision [s]
    flags: list[str]  # active faults, human-readable
    last: str  # last reason to limit or stop
    # use of the stamps of each input that came, `shared clock`, `growth only` or `none`
    stamps: dict[str, str] = field(default_factory=dict)


GuardInput: TypeAlias = tuple[Any, str, int | None, float | None]
"""Value as the feed of its kind takes it, sender, sequence, stamp on the sender's clock [s]."""
