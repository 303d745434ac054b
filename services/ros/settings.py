"""Settings of the edge to ROS 2: one TOML file, strict, every key with a range."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import (
    Quantities,
    non_negative,
    positive,
    quantity,
    validate_quantities,
)
from slopewise.services.io.decode import decode_table
from slopewise.services.io.files import read_toml, resolve_names
from slopewise.services.ros.naming import full_name

_MAX_PATHS = 100  # Candidates that the edge subscribes to: as many as a plan request may hold [1]


@dataclass(frozen=True, slots=True, kw_only=True)
class RosSettings:
    """Connection to ROS 2, and the node of the edge there.

    ``distribution`` auto: found in the robot's keys; dds: by zenoh-bridge-ros2dds.
    """

    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    config: str = ""  # file with zenoh's own settings; empty: none
    domain: int = quantity("1", "ROS_DOMAIN_ID.", default=0, at_least=0, at_most=232)
    distribution: Literal["auto", "humble", "jazzy", "kilted", "lyrical", "dds"] = "auto"
    namespace: str = "/"
    node: str = "slopewise"
    frame: str = ""  # required frame of map and paths; empty: that of the map

    def __post_init__(self) -> None:
        validate_quantities(self)
        names = {
            "namespace": f"{self.namespace.rstrip('/')}/x",
            "node": self.node.replace("/", " "),
        }
        for key, name in names.items():
            try:
                full_name("/", name)
            except ParameterError:
                expected = f"a name of ROS 2 such as robot, got {getattr(self, key)!r}"
                raise ParameterError(key, expected) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceEndpoint(Quantities):
    """The planning service."""

    connect: str = ""  # its endpoint, or a router's; empty: it is on the router of ROS 2
    config: str = ""  # file with zenoh's own settings; empty: none
    namespace: str = "slopewise/robot"
    timeout: float = positive("s", "For a reply.", default=0.08, at_most=10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """Topics; without a leading / they are in the node's namespace. Empty: not used."""

    paths: tuple[str, ...] = ("plan",)  # nav_msgs/Path
    map: str = "elevation_map"  # grid_map_msgs/GridMap
    layer: str = "elevation"  # its layer of heights
    odometry: str = "odom"  # nav_msgs/Odometry
    tf: str = "/tf"  # tf, tf_static: tf2_msgs/TFMessage, from odometry's frame to that of paths
    tf_static: str = "/tf_static"
    imu: str = ""  # sensor_msgs/Imu
    joints: str = ""  # sensor_msgs/JointState
    command: str = ""  # command that the vehicle received, geometry_msgs of type ``command_type``
    command_type: Literal["Twist", "TwistStamped"] = "TwistStamped"
    speed_limit: str = "speed_limit"  # out, nav2_msgs/SpeedLimit
    profile: str = "speed_plan"  # out, nav_msgs/Path
    diagnostics: str = "/diagnostics"  # out, diagnostic_msgs/DiagnosticArray
    stop: str = "speed_stop"  # out, std_msgs/Bool

    def __post_init__(self) -> None:
        if len(set(self.paths)) < len(self.paths) or len(self.paths) > _MAX_PATHS:
            raise ParameterError("paths", f"1 … {_MAX_PATHS} topics, each once")
        for name in ("odometry", "speed_limit"):
            if not getattr(self, name):
                raise ParameterError(name, "a topic, nothing works without it")
        single = {f.name for f in fields(self)} - {"paths", "layer", "command_type"}
        given = [(name, getattr(self, name)) for name in sorted(single) if getattr(self, name)]
        for name, topic in (*(("paths", path) for path in self.paths), *given):
            try:
                full_name("/", topic)
            except ParameterError as error:
                raise ParameterError(name, error.expected) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Periods, ages up to which inputs are used, and the horizon.

    ``clock`` of odometry's stamps; shared: the wall clock of this machine; ignored: stamps are not
    used, as of simulated time that runs slower.
    """

    period: float = quantity(
        "s", "Longest time between limits.", default=0.1, at_least=0.01, at_most=1.0
    )
    life: float = positive(
        "s", "Time over which a limit is the lowest planned speed.", default=0.5, at_most=5.0
    )
    path_age: float = positive("s", "Oldest path that is used.", default=3.0)
    odometry_age: float = positive("s", "Oldest odometry that is used.", default=0.3)
    clock: Literal["unknown", "shared", "ignored"] = "unknown"
    max_latency: float = non_negative(
        "s",
        "Longest delay from measurement to arrival; unused where stamps show it.",
        default=0.2,
        at_most=2.0,
    )
    transform_age: float = positive(
        "s", "Oldest transform that is used; fixed ones always are.", default=1.0
    )
    horizon: float = quantity(
        "m", "Length of a path ahead of the vehicle that is planned.", default=60.0, at_least=5.0
    )
    launch: float = non_negative(
        "m/s",
        "Lowest limit of a vehicle that moves, where the bounds allow it: motors do not creep.",
        default=0.15,
        at_most=1.0,
    )
    crawl: float = positive(
        "m/s", "Limit in place of a stop; 0 would mean no limit.", default=0.01, at_most=0.1
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.life <= self.period:
            raise ParameterError("life", f"more than period, {self.period:g} s")


@dataclass(frozen=True, slots=True, kw_only=True)
class FallbackStop(Quantities):
    """Stop that the brakes reach with certainty, used when the service does not reply."""

    deceleration: float = positive("m/s^2", "Mean.", default=1.5)
    dead_time: float = non_negative("s", "From command to onset.", default=0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelJoints:
    """Joints of the driven wheels, for learning the terrain; empty: not used."""

    left: str = ""
    right: str = ""
    radius: float = positive("m", "Of the loaded wheel.", default=0.165)

    def __post_init__(self) -> None:
        validate_quantities(self)
        if bool(self.left) != bool(self.right):
            raise ParameterError(
                "right" if self.left else "left", "a joint on either side, or none"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeSettings:
    """One edge."""

    ros: RosSettings = field(default_factory=RosSettings)
    service: ServiceEndpoint = field(default_factory=ServiceEndpoint)
    topics: Topics = field(default_factory=Topics)
    timing: Timing = field(default_factory=Timing)
    stop: FallbackStop = field(default_factory=FallbackStop)
    wheels: WheelJoints = field(default_factory=WheelJoints)


def read_settings(path: Path) -> EdgeSettings:
    """Settings in a TOML file; files named in it are relative to it."""
    data = read_toml(path)
    resolve_names(path, data, "ros.config", "service.config")
    return decode_table(EdgeSettings, data, str(path))
