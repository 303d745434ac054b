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
    """Where it meets others.

    Attributes:
        mode: client of a router, or a peer that listens. connect, listen: endpoints. config:
            zenoh's own settings. namespace: of the keys of the service.
    """

    mode: Literal["client", "peer"] = "client"
    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    listen: tuple[str, ...] = ()
    config: str = ""
    namespace: str = "slopewise/robot"


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardRos:
    """Topics of ROS 2; none of them without ``enabled``, then zenoh's own keys count.

    Attributes:
        command, output: in and out, of type ``kind``. odometry: in the frame of the map. stop: out,
            std_msgs/Bool, true: brake and hold. frame: that odometry has to be in; empty: any.
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
    """How long what is heard may be believed, and how quick a fault is answered.

    Attributes:
        clock: clock of stamps; shared: the wall clock of this machine; ignored: stamps
            are not used, as of simulated time that runs slower.
    """

    period: float = quantity(
        "s",
        "From one word to the base to the next, at least.",
        default=0.05,
        at_least=0.01,
        at_most=0.2,
    )
    command: float = quantity(
        "s", "A command older than that is none.", default=0.2, at_least=0.02, at_most=1.0
    )
    motion: float = quantity(
        "s", "Odometry older than that tells nothing.", default=0.2, at_least=0.02, at_most=1.0
    )
    clear: float = quantity(
        "s",
        "Likewise the clear distance, where one is awaited.",
        default=0.5,
        at_least=0.02,
        at_most=5.0,
    )
    map: float = quantity("s", "Likewise the map; a large one: it holds.", default=1e9, above=0.0)
    stall: float = quantity(
        "s",
        "A process that is silent for so long has failed.",
        default=0.2,
        at_least=0.05,
        at_most=2.0,
    )
    stands: float = quantity(
        "s",
        "A command is taken to hold for so long before anything is done about it.",
        default=0.1,
        at_least=0.0,
        at_most=2.0,
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
        """Within which any single fault ends in a stop being sent to the base [s]."""
        return max(self.command, self.motion, self.stall) + self.period


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardJudgement:
    """How strict it is.

    Attributes:
        awaits_clear: without a clear distance it stops. trust_learned: parameters of the service
            may make stops shorter than by the model file; else only longer.
    """

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
    awaits_clear: bool = False
    trust_learned: bool = False
    disobedience: float = quantity(
        "m/s", "Faster than it was told by so much, the base does not obey.", default=0.4, above=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardSettings:
    """One guard.

    Attributes:
        model: model file. map: elevation map (.npz) to begin with; empty: none until one comes.
    """

    model: str
    map: str = ""
    zenoh: GuardZenoh = field(default_factory=GuardZenoh)
    ros: GuardRos = field(default_factory=GuardRos)
    timing: GuardTiming = field(default_factory=GuardTiming)
    judgement: GuardJudgement = field(default_factory=GuardJudgement)


def read_guard_settings(path: Path) -> GuardSettings:
    """The settings in a TOML file; files named in it are taken relative to it.

    Raises:
        InputError: names the file and the key.
    """
    data = read_toml(path)
    resolve_names(path, data, "model", "map", "zenoh.config")
    return decode_table(GuardSettings, data, str(path))


def model_path(settings: GuardSettings) -> Path:
    """The model file: one that exists, or that of a shipped vehicle."""
    path = Path(settings.model)
    return path if path.is_file() else shipped_files("vehicles").get(settings.model, path)
