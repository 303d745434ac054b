"""A robot with ROS 2 and rmw_zenoh, emulated: a process that knows zenoh and rosbags alone.

Keys, tokens and attachments are written out here as rmw_zenoh's design document gives them; nothing
of slopewise is imported. Prints what it saw as JSON.
"""

from __future__ import annotations

import argparse
import json
import struct
import threading
import time
from typing import Any

import numpy as np
import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(
    {
        **get_types_from_msg(
            "std_msgs/Header header\nbool percentage\nfloat64 speed_limit",
            "nav2_msgs/msg/SpeedLimit",
        ),
        **get_types_from_msg(
            "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose",
            "grid_map_msgs/msg/GridMapInfo",
        ),
        **get_types_from_msg(
            "std_msgs/Header header\ngrid_map_msgs/GridMapInfo info\nstring[] layers\n"
            "string[] basic_layers\nstd_msgs/Float32MultiArray[] data\n"
            "uint16 outer_start_index\nuint16 inner_start_index",
            "grid_map_msgs/msg/GridMap",
        ),
    }
)
T = STORE.types
GID = bytes(range(16))
AHEAD = [0.0]
"""Time that passes on top, for a test that puts all clocks forward [s]."""


def dds(kind: str) -> str:
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def key(topic: str, kind: str) -> str:
    return f"0/{topic}/{dds(kind)}/{STORE.hash_rihs01(kind)}"


def header(frame: str = "odom") -> Any:
    now = time.time_ns() + round(1e9 * AHEAD[0])
    stamp = T["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
    return T["std_msgs/msg/Header"](stamp, frame)


def pose(x: float, y: float) -> Any:
    point = T["geometry_msgs/msg/Point"](x, y, 0.0)
    return T["geometry_msgs/msg/Pose"](point, T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))


def path(length: float) -> Any:
    stamped = T["geometry_msgs/msg/PoseStamped"]
    along = np.linspace(0.0, length, 60).tolist()
    return T["nav_msgs/msg/Path"](header(), [stamped(header(), pose(x, 0.0)) for x in along])


def odometry(speed: float) -> Any:
    zero = T["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = T["geometry_msgs/msg/Twist"](T["geometry_msgs/msg/Vector3"](speed, 0.0, 0.0), zero)
    here = T["geometry_msgs/msg/PoseWithCovariance"](pose(0.0, 0.0), np.zeros(36))
    moving = T["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
    return T["nav_msgs/msg/Odometry"](header(), "base_link", here, moving)


def ground(rows: int = 200, columns: int = 80, cell: float = 0.25) -> Any:
    """Level ground from -10 m to 40 m along x, the buffer turned by half."""
    layout = T["std_msgs/msg/MultiArrayLayout"](
        [
            T["std_msgs/msg/MultiArrayDimension"]("column_index", columns, rows * columns),
            T["std_msgs/msg/MultiArrayDimension"]("row_index", rows, rows),
        ],
        0,
    )
    heights = T["std_msgs/msg/Float32MultiArray"](layout, np.zeros(rows * columns, np.float32))
    info = T["grid_map_msgs/msg/GridMapInfo"](cell, rows * cell, columns * cell, pose(15.0, 0.0))
    return T["grid_map_msgs/msg/GridMap"](
        header(), info, ["elevation"], ["elevation"], [heights], rows // 2, columns // 2
    )


class Peer:
    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        self.session = zenoh.open(config)
        self.limits: list[tuple[float, float]] = []
        self.stops: list[bool] = []
        self.attachments: list[bytes] = []
        self.profiles: list[Any] = []
        self.diagnoses: list[Any] = []
        self.sequence = 0
        self.raw: dict[str, bytes] = {}
        self.subscribers = [
            self.session.declare_subscriber(key(topic, kind), act)
            for topic, kind, act in (
                ("speed_limit", "nav2_msgs/msg/SpeedLimit", self.on_limit),
                ("speed_stop", "std_msgs/msg/Bool", self.on_stop),
                ("speed_plan", "nav_msgs/msg/Path", self.on_profile),
                ("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", self.on_diagnosis),
            )
        ]

    def on_limit(self, sample: zenoh.Sample) -> None:
        at = time.monotonic()
        message = STORE.deserialize_cdr(sample.payload.to_bytes(), "nav2_msgs/msg/SpeedLimit")
        assert not message.percentage
        self.limits.append((at, message.speed_limit))
        self.attachments.append(sample.attachment.to_bytes())

    def on_stop(self, sample: zenoh.Sample) -> None:
        self.stops.append(
            STORE.deserialize_cdr(sample.payload.to_bytes(), "std_msgs/msg/Bool").data
        )

    def on_profile(self, sample: zenoh.Sample) -> None:
        self.profiles.append(STORE.deserialize_cdr(sample.payload.to_bytes(), "nav_msgs/msg/Path"))

    def on_diagnosis(self, sample: zenoh.Sample) -> None:
        kind = "diagnostic_msgs/msg/DiagnosticArray"
        self.diagnoses.append(STORE.deserialize_cdr(sample.payload.to_bytes(), kind))

    def send(self, topic: str, kind: str, message: Any, tail: bytes = b"", cut: int = 0) -> None:
        self.sequence += 1
        attachment = struct.pack("<qqB16s", self.sequence, time.time_ns(), 16, GID)
        data = bytes(STORE.serialize_cdr(message, kind)) + tail
        self.session.put(key(topic, kind), data[: len(data) - cut], attachment=attachment)

    def tokens(self) -> list[str]:
        replies = self.session.liveliness().get("@ros2_lv/0/**", timeout=2.0)
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok)

    def drive(self, seconds: float, rate: float, speed: float, length: float) -> list[float]:
        """Odometry at 50 Hz, a path every period; time that each limit took [s]."""
        stopped = threading.Event()

        def odometers() -> None:
            while not stopped.wait(0.02):
                self.send("odom", "nav_msgs/msg/Odometry", odometry(speed))

        background = threading.Thread(target=odometers)
        background.start()
        took = []
        begun = time.monotonic()
        for k in range(round(seconds * rate)):
            message = path(length)
            time.sleep(max(0.0, begun + k / rate - time.monotonic()))
            if k % round(rate) == 0:
                self.send("elevation_map", "grid_map_msgs/msg/GridMap", ground())
            sent = time.monotonic()
            seen = len(self.limits)
            self.send("plan", "nav_msgs/msg/Path", message)
            until = sent + 0.9 / rate
            while len(self.limits) <= seen and time.monotonic() < until:
                time.sleep(0.0005)
            took.append((self.limits[seen][0] if len(self.limits) > seen else np.inf) - sent)
        stopped.set()
        background.join()
        return took


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("endpoint")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rate", type=float, default=20.0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--bad", action="store_true", help="end with paths that are not usable")
    given = parser.parse_args()
    peer = Peer(given.endpoint)
    tokens = peer.tokens()
    took = peer.drive(given.seconds, given.rate, given.speed, 30.0)
    report: dict[str, Any] = {
        "tokens": tokens,
        "took": took,
        "limits": [limit for _, limit in peer.limits],
        "attachments": [data.hex() for data in peer.attachments],
        "stops": peer.stops,
        "last_stop": peer.stops[-1],
        "profile": [
            (p.header.stamp.sec + 1e-9 * p.header.stamp.nanosec, p.pose.position.x)
            for p in (peer.profiles[-1].poses if peer.profiles else [])
        ],
    }
    # Then messages that are not usable, besides odometry.
    report["refused"] = {}
    for defect in ("cut", "tail", "hash") if given.bad else ():
        kind, until = "nav_msgs/msg/Path", time.monotonic() + 1.2
        while time.monotonic() < until:
            peer.send("odom", "nav_msgs/msg/Odometry", odometry(given.speed))
            if defect == "hash":
                wrong = key("plan", kind).replace("RIHS01_", "RIHS01_00")
                peer.session.put(wrong, bytes(STORE.serialize_cdr(path(30.0), kind)))
            else:
                peer.send(
                    "plan", kind, path(30.0), **{"cut": {"cut": 5}, "tail": {"tail": b"\1"}}[defect]
                )
            time.sleep(0.05)
        values = {pair.key: pair.value for pair in peer.diagnoses[-1].status[0].values}
        report["refused"][defect] = (int(values.get("refused", 0)), values.get("refused /plan", ""))
    if not given.bad:
        time.sleep(1.0)
    report["after"] = [limit for _, limit in peer.limits[-3:]]
    report["stop_after"] = peer.stops[-1]
    status = peer.diagnoses[-1].status[0]
    report["diagnosis"] = {
        "level": int(status.level),
        "message": status.message,
        "values": {pair.key: pair.value for pair in status.values},
    }
    print(json.dumps(report))
    peer.session.close()


if __name__ == "__main__":
    main()
