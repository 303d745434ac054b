"""Which messages of a recording are most likely which column, where nobody says so.

A topic is taken by its type: the only one of it, or the only one with the usual name. What is not
certain is not guessed; then the shipped mapping holds, and its error says what there is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from slopewise.services.io.bags.topics import Channel

_ODOMETRY = "nav_msgs/msg/Odometry"
_IMU = "sensor_msgs/msg/Imu"
_COMMANDS = {
    "geometry_msgs/msg/Twist": "linear.x",
    "geometry_msgs/msg/TwistStamped": "twist.linear.x",
}
_USUAL = {_ODOMETRY: "odom", _IMU: "imu", "command": "cmd_vel"}


def guessed(channels: Mapping[str, Channel], recorded: Mapping[str, str]) -> dict[str, Channel]:
    """Channels of a recording.

    Args:
        channels: the shipped ones: v, v_cmd, pitch.
        recorded: type of each topic.

    Returns:
        them, with the topics that are there, and roll and yaw rate of the same IMU.
    """
    found = dict(channels)
    if odometry := _topic(recorded, {_ODOMETRY}, _USUAL[_ODOMETRY]):
        found["v"] = replace(found["v"], topic=odometry)
    if command := _topic(recorded, set(_COMMANDS), _USUAL["command"]):
        field = _COMMANDS[recorded[command]]
        found["v_cmd"] = replace(found["v_cmd"], topic=command, field=field)
    if imu := _topic(recorded, {_IMU}, _USUAL[_IMU]):
        found["pitch"] = replace(found["pitch"], topic=imu)
        found.setdefault("roll", Channel(topic=imu, quaternion="orientation"))
        found.setdefault("yaw_rate", Channel(topic=imu, field="angular_velocity.z"))
    return found


def _topic(recorded: Mapping[str, str], kinds: set[str], usual: str) -> str:
    """The only topic of some types, or the only one of them with the usual name; else none."""
    of_kind = [topic for topic, kind in recorded.items() if kind in kinds]
    named = [topic for topic in of_kind if usual in topic.split("/")]
    for choice in (of_kind, named):
        if len(choice) == 1:
            return choice[0]
    return ""
