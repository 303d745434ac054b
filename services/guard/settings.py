"""Settings of the guard: one TOML file, strict, every key with a range."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.services.io.decode import decode_table
from slopewise.services.io.files import read_toml, resolve_names, shipped_files


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardZenoh:
    """Zenoh session.

    Attributes:
        mode: client of a router, or a peer that listens.
        connect, listen: endpoints.
        config: file with zenoh's own settings; empty: none.
        namespace: prefix of the keys of the service.
    """

    mode: Literal["client", "peer"] = "client"
    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    listen: tuple[str, ...] = ()
    config: str = ""
    namespace: str = "slopewise/robot"


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardRos:
    """Topics of ROS 2; used if ``enabled``, else zenoh's own keys are.

    Attributes:
        command, output: commands in and out, of type ``kind``.
        odometry: in the frame of the map.
        stop: std_msgs/Bool, true: brake and hold.
        frame: required frame of odometry; empty: any.
    """

    enabled: bool = False
    domain: int = quantity("1", "ROS_DOMAIN_ID.", default=0, at_least=0, at_most=232)
    distribution: Literal["auto", "humble", "jazzy", "kilted", "lyrical", "dds"] = "auto"
    namespace: str = "/"
    node: str = "slopewise_guard"
    kind: Literal["Twist", "TwistStamped"] = "TwistStamped"
    command: str = "cmd_vel_nav"
    output: str = "cmd_vel"
    odometry: str = "odom"
    stop: str = "guard_stop"
    frame: str = ""

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.command == self.output:
            raise ParameterError("output", "another topic than that of the commands")


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardTiming:
    """Ages up to which inputs are used, and times within which a fault is answered.

    Attributes:
        clock: clock of stamps; shared: the wall clock of this machine; ignored: stamps
            are not used, as of simulated time that runs slower.
    """

    period: float = quantity(
        "s", "Longest time between outputs.", default=0.05, at_least=0.01, at_most=0.2
    )
    command: float = quantity(
        "s", "Oldest command that is used.", default=0.2, at_least=0.02, at_most=1.0
    )
    motion: float = quantity(
        "s", "Oldest odometry that is used.", default=0.2, at_least=0.02, at_most=1.0
    )
    clear: float = quantity(
        "s", "Oldest clear distance that is used.", default=0.5, at_least=0.02, at_most=5.0
    )
    map: float = quantity("s", "Oldest map that is used; large: any.", default=1e9, above=0.0)
    stall: float = quantity(
        "s", "Silence from which a process has failed.", default=0.2, at_least=0.05, at_most=2.0
    )
    stands: float = quantity(  # words: ok, key
        "s", "Time for which a command may stay in force.", default=0.1, at_least=0.0, at_most=2.0
    )
    clock: Literal["unknown", "shared", "ignored"] = "unknown"
    max_latency: float = quantity(
        "s",
        "Longest delay from measurement to arrival; unused where stamps show it.",
        default=0.2,
        at_least=0.0,
        at_most=2.0,
    )
    transport: float = quantity(
        "s",
        "From the guard to the base, if not in the dead time of the model.",
        default=0.02,
        at_least=0.0,
        at_most=1.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)

    @property
    def reaction(self) -> float:
        """Time within which any single fault ends in a stop that is sent to the base [s]."""
        return max(self.command, self.motion, self.stall) + self.period


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardJudgement:  # words: ok, key
    """Strictness."""

    load: float = quantity(
        "1",
        "Share of min_load that axles and sides keep in every stop.",
        default=0.5,
        at_least=0.0,
        at_most=1.0,
    )
    reserve: float = quantity(
        "m", "Kept of the clear distance for errors of localisation.", default=0.15, at_least=0.0
    )
    awaits_clear: bool = False  # stop without a clear distance
    # parameters of the service may make stops shorter than by the model file; else only longer
    trust_learned: bool = False
    disobedience: float = quantity(  # words: ok, key
        "m/s", "Excess over the commanded speed that is a fault.", default=0.4, above=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardSettings:
    """One guard.

    Attributes:
        model: model file or shipped vehicle.
        map: elevation map (.npz) to begin with; empty: none until one comes.
    """

    model: str
    map: str = ""
    zenoh: GuardZenoh = field(default_factory=GuardZenoh)
    ros: GuardRos = field(default_factory=GuardRos)
    timing: GuardTiming = field(default_factory=GuardTiming)
    judgement: GuardJudgement = field(default_factory=GuardJudgement)  # words: ok, key


def read_guard_settings(path: Path) -> GuardSettings:
    """Settings in a TOML file; files named in it are relative to it."""
    data = read_toml(path)
    resolve_names(path, data, "model", "map", "zenoh.config")
    return decode_table(GuardSettings, data, str(path))


def model_path(settings: GuardSettings) -> Path:
    """Model file: one that exists, or that of a shipped vehicle."""
    path = Path(settings.model)
    return path if path.is_file() else shipped_files("vehicles").get(settings.model, path)
