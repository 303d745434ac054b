"""Topic mappings: which messages of a recording hold map, candidates, columns of a drive log.

Without a mapping, a topic of a drive log is inferred from its type: the only one of it, or the only
one with the usual name. What is ambiguous is not inferred; then the shipped mapping holds, and its
error lists the recorded topics.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.services.io.bags import ODOMETRY
from slopewise.services.io.decode import decode_table, dotted
from slopewise.services.io.files import fault, read_toml, shipped_folder
from slopewise.services.io.units import REQUIRED

ATTITUDE = ("roll", "pitch", "yaw")
_NO_COLUMN = ("run", "t")
_SOURCES = ("map", "paths")

_IMU = "sensor_msgs/msg/Imu"
_COMMANDS = {
    "geometry_msgs/msg/Twist": "linear.x",
    "geometry_msgs/msg/TwistStamped": "twist.linear.x",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Where the values of one column are."""

    topic: str
    field: str | None = None  # dotted path of a number; for a joint, one of its lists
    quaternion: str | None = None
    joint: str | None = None
    scale: float = quantity("1", "Factor to the unit of the drive log.", default=1.0)
    offset: float = quantity("1", "Added after scaling, in the drive log's unit.", default=0.0)
    hold: bool = False

    def __post_init__(self) -> None:
        validate_quantities(self)
        if (self.field is None) == (self.quaternion is None):
            raise ParameterError("field", "either field or quaternion")
        if self.joint is not None and self.field not in ("position", "velocity", "effort"):
            raise ParameterError("field", "position, velocity or effort for a joint")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSource:
    """Where the elevation map is."""

    topic: str = ""  # of grid maps; empty: the only one
    layer: str = ""  # layer with the heights; empty: `elevation`
    message: int = -1  # its number from 0, -1 for the last


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSource:
    """Where candidates are."""

    topics: tuple[str, ...] = ()  # topics of paths; empty: all of them
    all_messages: bool = False  # each message is a candidate, not only the last of each topic


def read_sources(path: Path | None) -> tuple[MapSource, PathSource]:
    """Where map and candidates are; without a mapping, the only ones of their type."""
    if path is None:
        return MapSource(), PathSource()
    tables = read_toml(path)
    return (
        decode_table(MapSource, tables.get("map", {}), str(path), "map"),
        decode_table(PathSource, tables.get("paths", {}), str(path), "paths"),
    )


def read_topics(path: Path | None) -> tuple[dict[str, Channel], str]:
    """The mapping by column, and the name of its file; without one, the mapping that is shipped."""
    path = path or shipped_folder() / "topics.toml"
    channels = {}
    for column, table in read_toml(path).items():
        if column in _SOURCES:
            continue
        if column in _NO_COLUMN:
            raise fault(path, dotted("", column), "expected a measured column, this one is made")
        channel = decode_table(Channel, table, str(path), dotted("", column))
        if channel.quaternion is not None and column not in ATTITUDE:
            expected = f"expected one of {', '.join(ATTITUDE)} from a quaternion, got {column}"
            raise fault(path, dotted("", column), expected)
        channels[column] = channel
    for column in REQUIRED:
        if column != "t" and column not in channels:
            raise fault(path, column, "missing table, every drive log needs this column")
    return channels, str(path)


def infer_channels(
    shipped: Mapping[str, Channel], recorded: Mapping[str, str]
) -> dict[str, Channel]:
    """The shipped channels with the topics that a recording has, and more from the same IMU."""
    channels = dict(shipped)
    if odometry := only_topic(recorded, {ODOMETRY}, "odom"):
        channels["v"] = replace(channels["v"], topic=odometry)
    if command := only_topic(recorded, set(_COMMANDS), "cmd_vel"):
        field = _COMMANDS[recorded[command]]
        channels["v_cmd"] = replace(channels["v_cmd"], topic=command, field=field)
    if imu := only_topic(recorded, {_IMU}, "imu"):
        channels["pitch"] = replace(channels["pitch"], topic=imu)
        channels.setdefault("roll", Channel(topic=imu, quaternion="orientation"))
        channels.setdefault("yaw_rate", Channel(topic=imu, field="angular_velocity.z"))
    return channels


def only_topic(recorded: Mapping[str, str], kinds: set[str], conventional: str) -> str:
    """The only topic of some types, else the only one of them with a conventional name, else ""."""
    of_kind = [topic for topic, kind in recorded.items() if kind in kinds]
    named = [topic for topic in of_kind if conventional in topic.split("/")]
    for choice in (of_kind, named):
        if len(choice) == 1:
            return choice[0]
    return ""
