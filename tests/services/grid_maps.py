"""Grid maps as ROS 2 writes them, and a reader of their bytes that knows nothing of rosbags."""

from __future__ import annotations

import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.services.io.bags import GRID_MAP, PATH, typestore


def header(frame: str = "map", sec: int = 5, nanosec: int = 0) -> Any:
    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def pose(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Any:
    types = typestore().types
    q = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0))
    return types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), q)


def grid_map(
    heights: np.ndarray,
    resolution: float = 0.5,
    centre: tuple[float, float] = (0.0, 0.0),
    *,
    start: tuple[int, int] = (0, 0),
    frame: str = "map",
    basic: tuple[str, ...] = ("elevation",),
    more: dict[str, np.ndarray] | None = None,
    by_column: bool = True,
    yaw: float = 0.0,
) -> Any:
    """Of (rows, columns): rows towards -x, columns towards -y, put into a circular buffer."""
    types = typestore().types
    rows, columns = heights.shape
    layers = {"elevation": heights, **(more or {})}
    dims = [("column_index", columns, rows * columns), ("row_index", rows, rows)]
    if not by_column:
        dims = [("row_index", rows, rows * columns), ("column_index", columns, columns)]
    layout = types["std_msgs/msg/MultiArrayLayout"](
        [types["std_msgs/msg/MultiArrayDimension"](*dim) for dim in dims], 0
    )
    data = []
    for values in layers.values():
        buffer = np.roll(values.astype(np.float32), start, axis=(0, 1))
        flat = buffer.ravel(order="F" if by_column else "C")
        data.append(types["std_msgs/msg/Float32MultiArray"](layout, np.ascontiguousarray(flat)))
    info = types["grid_map_msgs/msg/GridMapInfo"](
        resolution, rows * resolution, columns * resolution, pose(*centre, yaw)
    )
    return types[GRID_MAP](header(frame), info, list(layers), list(basic), data, *start)


def path(points: np.ndarray, frame: str = "map", pose_frame: str = "") -> Any:
    types = typestore().types
    stamped = types["geometry_msgs/msg/PoseStamped"]
    return types[PATH](
        header(frame), [stamped(header(pose_frame), pose(float(x), float(y))) for x, y in points]
    )


@dataclass
class Decoded:
    """Layers as (rows, columns) of the buffer, by struct alone."""

    resolution: float
    length: tuple[float, float]
    position: tuple[float, float]
    basic: list[str]
    layers: dict[str, np.ndarray]
    start: tuple[int, int]

    def height(self, row: int, column: int) -> tuple[float, float, float]:
        """(x, y, z) of a cell of the unwrapped grid, as grid_map's getPosition counts."""
        rows, columns = self.layers["elevation"].shape
        x = self.position[0] + (self.length[0] - self.resolution) / 2.0 - row * self.resolution
        y = self.position[1] + (self.length[1] - self.resolution) / 2.0 - column * self.resolution
        at = (row + self.start[0]) % rows, (column + self.start[1]) % columns
        valid = all(np.isfinite(self.layers[name][at]) for name in self.basic)
        return x, y, float(self.layers["elevation"][at]) if valid else float("nan")


class _Bytes:
    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\x00\x01\x00\x00"
        self.data, self.at = data[4:], 0

    def number(self, code: str) -> Any:
        size = struct.calcsize(code)
        self.at += -self.at % size
        (value,) = struct.unpack_from("<" + code, self.data, self.at)
        self.at += size
        return value

    def text(self) -> str:
        size = self.number("I")
        self.at += size
        return self.data[self.at - size : self.at - 1].decode()


def decode(data: bytes) -> Decoded:
    b = _Bytes(data)
    b.number("i"), b.number("I"), b.text()
    resolution, *length = (b.number("d") for _ in range(3))
    position = [b.number("d") for _ in range(7)][:2]
    names = [b.text() for _ in range(b.number("I"))]
    basic = [b.text() for _ in range(b.number("I"))]
    layers = {}
    for i in range(b.number("I")):
        dims = []
        for _ in range(b.number("I")):
            label, size, _stride = b.text(), b.number("I"), b.number("I")
            dims.append((label, size))
        assert [label for label, _ in dims] == ["column_index", "row_index"]
        b.number("I")
        columns, rows = (size for _, size in dims)
        values = np.empty((rows, columns))
        assert b.number("I") == rows * columns
        for column in range(columns):
            for row in range(rows):
                values[row, column] = b.number("f")
        layers[names[i]] = values
    start = b.number("H"), b.number("H")
    assert b.at == len(b.data)
    return Decoded(resolution, tuple(length), tuple(position), basic, layers, start)  # type: ignore[arg-type]


def last_raw(folder: Path) -> bytes:
    """The last message of a recording with one topic, without rosbags."""
    file = next(p for p in folder.iterdir() if p.suffix in (".db3", ".mcap"))
    if file.suffix == ".db3":
        with sqlite3.connect(f"file:{file}?immutable=1", uri=True) as base:
            return bytes(
                base.execute("SELECT data FROM messages ORDER BY timestamp").fetchall()[-1][0]
            )
    from mcap.reader import make_reader

    with file.open("rb") as stream:
        return bytes([message.data for _, _, message in make_reader(stream).iter_messages()][-1])
