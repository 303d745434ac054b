"""Settings of the guard: one TOML file, strict, every key with a range."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.services.io.decode import decode_table
from slopewise.services.io.files import read_toml, resolve_names


def _seconds(text: str, default: float, at_least: float, at_most: float) -> Any:
    return quantity("s", text, default=default, at_least=at_least, at_most=at_most)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardZenoh:
    """Zenoh session."""

    mode: Literal["client", "peer"] = "client"  # of a router, or a peer
    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    listen: tuple[str, ...] = ()
    config: str = ""  # file with zenoh's own settings
    namespace: str = "slopewise/robot"  # prefix of the keys of the service

    def __post_init__(self) -> None:
        if self.mode == "peer" and any(not end.endswith(":0") for end in self.listen):
            expected = "none with a port, which only one of the guard's two processes can have"
            raise ParameterError("listen", f"{expected}: connect them to a router")


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardRos:
    """Topics of ROS 2; used if ``enabled``, else zenoh's own keys are."""

    enabled: bool = False
    domain: int = quantity("1", "ROS_DOMAIN_ID.", default=0, at_least=0, at_most=232)
    distribution: Literal["auto", "humble", "jazzy", "kilted", "lyrical", "dds"] = "auto"
    namespace: str = "/"
    node: str = "slopewise_guard"
    kind: Literal["Twist", "TwistStamped"] = "TwistStamped"  # type of commands in and out
    command: str = "cmd_vel_nav"
    output: str = "cmd_vel"
    odometry: str = "odom"  # in the frame of the map
    stop: str = "guard_stop"  # std_msgs/Bool, true: brake and hold
    confirm: str = "guard_pose"  # PoseWithCovarianceStamped of an operator, in that frame
    frame: str = ""  # required frame of odometry; empty: any

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.command == self.output:
            raise ParameterError("output", "another topic than that of the commands")


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardTiming:
    """Ages up to which inputs are used, and times within which a fault is answered.

    ``clock``: of stamps; shared: the wall clock of this machine; ignored: stamps are not used, as
    of simulated time that runs slower.
    """

    period: float = _seconds("Longest time between outputs.", 0.05, 0.01, 0.2)
    command: float = _seconds("Oldest command that is used.", 0.2, 0.02, 1.0)
    motion: float = _seconds("Oldest odometry that is used.", 0.2, 0.02, 1.0)
    clear: float = _seconds("Oldest clear distance that is used.", 0.5, 0.02, 5.0)
    map: float = quantity("s", "Oldest map that is used; large: any.", default=1e9, above=0.0)
    stall: float = _seconds("Silence from which a process has failed.", 0.2, 0.05, 2.0)
    stands: float = _seconds("For which a command may hold.", 0.1, 0.0, 2.0)  # words: ok, key
    clock: Literal["unknown", "shared", "ignored"] = "unknown"
    max_latency: float = _seconds("Longest delay that no stamp shows.", 0.2, 0.0, 2.0)
    transport: float = _seconds("To the base, unless in its dead time.", 0.02, 0.0, 1.0)

    def __post_init__(self) -> None:
        validate_quantities(self)

    @property
    def reaction(self) -> float:
        """Time within which any single fault ends in a stop that is sent to the base [s]."""
        return max(self.command, self.motion, self.stall) + self.period


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardJudgement:  # words: ok, key
    """Strictness; ``load``: share of min_load that axles and sides keep in every stop."""

    load: float = quantity("1", "Share of min_load.", default=0.5, at_least=0.0, at_most=1.0)
    reserve: float = quantity(
        "m", "Kept of the clear distance for errors of localisation.", default=0.15, at_least=0.0
    )
    jump: float = quantity(
        "m", "Correction of the pose between two messages.", default=0.5, above=0.0
    )
    awaits_clear: bool = False  # stop without a clear distance
    awaits_parameters: bool = False  # stop until the service has answered after the start
    trust_learned: bool = False  # learned brakes may make stops shorter than by the model file
    disobedience: float = quantity(  # words: ok, key
        "m/s", "Excess over the commanded speed that is a fault.", default=0.4, above=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardSettings:
    """One guard."""

    model: str  # model file or shipped vehicle
    map: str = ""  # elevation map (.npz) to begin with; empty: none until one comes
    zenoh: GuardZenoh = field(default_factory=GuardZenoh)
    ros: GuardRos = field(default_factory=GuardRos)
    timing: GuardTiming = field(default_factory=GuardTiming)
    judgement: GuardJudgement = field(default_factory=GuardJudgement)  # words: ok, key


def read_guard_settings(path: Path) -> GuardSettings:
    """Settings in a TOML file; files named in it are relative to it."""
    data = read_toml(path)
    resolve_names(path, data, "model", "map", "zenoh.config")
    return decode_table(GuardSettings, data, str(path))
