"""Makes data/rclpy_kilted.json: bytes by the real client library, and the values behind them.

Run once, outside of the project's environment, with these packages of PyPI:
``ros-kilted-rclpy[fastrtps]``, ``ros-kilted-nav-msgs``, ``ros-kilted-sensor-msgs`` and
``ros-kilted-diagnostic-msgs``.
With a second file of bytes that slopewise wrote, it reads them back and compares the values.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path as File
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float32MultiArray, Header, MultiArrayDimension, String

PACKAGES = ("ros-kilted-rclpy", "ros-fastcdr", "ros-nav-msgs", "ros-sensor-msgs")


def header(frame: str, k: int = 1) -> Any:
    return Header(stamp=Time(sec=1_800_000_000 + k, nanosec=5_000_001 * k), frame_id=frame)


def pose(k: int) -> Any:
    stamped = PoseStamped(header=header("map", k))
    stamped.pose.position.x, stamped.pose.position.y = 0.5 * k, -0.25 * k
    stamped.pose.orientation.z, stamped.pose.orientation.w = 0.6, 0.8
    return stamped


def twist() -> Any:
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = 1.25, -0.5, 0.75
    return message


def odometry() -> Any:
    message = Odometry(header=header("odom"), child_frame_id="base_link")
    message.pose.pose, message.twist.twist = pose(3).pose, twist()
    message.pose.covariance, message.twist.covariance = [0.01 * k for k in range(36)], [0.5] * 36
    return message


def imu() -> Any:
    message = Imu(header=header("imu_link"))
    message.orientation.x, message.orientation.w = 0.1, 0.99
    message.orientation_covariance = [float(k) for k in range(9)]
    message.angular_velocity.z, message.linear_acceleration.z = 0.3, 9.8
    return message


def diagnostics() -> Any:
    values = [KeyValue(key="a", value="1"), KeyValue(key="limit [m/s]", value="1.250")]
    status = DiagnosticStatus(
        level=b"\x01",
        name="slopewise: speed plan",
        message="nobody",
        hardware_id="r",
        values=values,
    )
    return DiagnosticArray(header=header(""), status=[status])


def numbers() -> Any:
    message = Float32MultiArray(data=[0.5, -1.5, 2.0])
    message.layout.dim = [MultiArrayDimension(label="column_index", size=3, stride=3)]
    return message


MESSAGES = {
    "nav_msgs/msg/Path": [
        Path(header=header("map"), poses=[pose(k) for k in range(4)]),
        Path(header=header("odometry")),
    ],
    "nav_msgs/msg/Odometry": [odometry()],
    "geometry_msgs/msg/Twist": [twist()],
    "geometry_msgs/msg/TwistStamped": [TwistStamped(header=header("base"), twist=twist())],
    "geometry_msgs/msg/TransformStamped": [
        TransformStamped(header=header("map"), child_frame_id="odom")
    ],
    "sensor_msgs/msg/Imu": [imu()],
    "sensor_msgs/msg/JointState": [
        JointState(
            header=header(""), name=["left", "r"], position=[1.0, 2.0], velocity=[0.5, -0.5]
        ),
        JointState(header=header("x"), name=["a"]),
    ],
    "std_msgs/msg/Bool": [Bool(data=True), Bool(data=False)],
    "std_msgs/msg/String": [String(data="ab")],
    "std_msgs/msg/Header": [header("abc")],
    "std_msgs/msg/Float32MultiArray": [numbers()],
    "diagnostic_msgs/msg/DiagnosticArray": [diagnostics()],
}


def plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0]
    if isinstance(value, str | bool | int | float):
        return value
    return [plain(item) for item in value]


def hash_of(kind: str) -> str:
    described = json.loads((File(sys.prefix) / "share" / f"{kind}.json").read_text())
    return str({h["type_name"]: h["hash_string"] for h in described["type_hashes"]}[kind])


def main() -> None:
    messages = [
        {"type": kind, "bytes": serialize_message(message).hex(), "values": plain(message)}
        for kind, examples in MESSAGES.items()
        for message in examples
    ]
    document = {
        "made_by": {name: version(name) for name in PACKAGES},
        "hashes": {kind: hash_of(kind) for kind in MESSAGES},
        "messages": messages,
    }
    File(sys.argv[1]).write_text(json.dumps(document, indent=1) + "\n")
    for written in json.loads(File(sys.argv[2]).read_text()) if len(sys.argv) > 2 else ():
        kind = type(MESSAGES[written["type"]][0])
        back = plain(deserialize_message(bytes.fromhex(written["bytes"]), kind))
        assert back == written["values"], (written["type"], back)
        print("read back", written["type"])


if __name__ == "__main__":
    main()
