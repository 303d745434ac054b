"""What travels to and from the guard where there is no ROS 2; SI, as all messages of the service.

Every message counts up for its sender, so that one that is repeated, or comes late, is known.
``time`` is when it was measured or sent, on a clock of the sender [s]; without it a delay that
grows cannot be seen.
"""

from __future__ import annotations

from msgspec import field

from slopewise.services.wire.messages import Message, Name, NotNegative, Number


class GuardCommand(Message, frozen=True):
    """What whoever plans wants of the base: speed [m/s], forward positive; yaw rate [rad/s]."""

    source: Name
    sequence: Number
    speed: float
    yaw_rate: float
    time: float | None = None


class GuardMotion(Message, frozen=True):
    """Where the middle of the wheelbase is on the map, and how fast it is [m/s]."""

    source: Name
    sequence: Number
    x: float
    y: float
    heading: float
    speed: float
    time: float | None = None


class GuardClear(Message, frozen=True):
    """How far the way ahead is known free for the middle of the wheelbase [m]."""

    source: Name
    sequence: Number
    distance: NotNegative
    time: float | None = None


class GuardOutput(Message, frozen=True):
    """What the base is told.

    Attributes:
        source, sequence: of the guard. of: number of the command it is the answer to, 0 of none.
        speed, yaw_rate: as of a command. brake: as hard as it can, and hold.
        action: `pass`, `slow` or `stop`. reason: in words.
    """

    source: Name
    sequence: Number
    of: Number
    speed: float
    yaw_rate: float
    brake: bool
    action: str
    reason: str


class GuardStatus(Message, frozen=True):
    """How the guard is; ``reaction``: within which any fault ends in a stop being sent [s].

    ``counters``: since the start. ``ages``: of what it hears [s], −1 of what never came.
    ``flags``: what is not as it should be. ``last``: the last reason to slow or stop.
    ``stamps``: of each message kind that came, `shared clock`, `growth only` or `none`.
    """

    uptime: float
    reaction: float
    counters: dict[str, int]
    ages: dict[str, float]
    seconds: dict[str, float]
    flags: list[str]
    last: str
    stamps: dict[str, str] = field(default_factory=dict)
